/* What programs need on a graphics card, where there are no headers. */

#ifdef __CUDACC_RTC__

typedef unsigned int uint32_t;
typedef unsigned long long uint64_t;

#define INT_MAX 2147483647
#define INT_MIN (-INT_MAX - 1)
#define LLONG_MAX 9223372036854775807LL
#define DBL_MAX 1.7976931348623157e308
#define NAN __builtin_bit_cast(double, 0x7ff8000000000000ULL)
#define INFINITY __builtin_bit_cast(double, 0x7ff0000000000000ULL)
#define offsetof(type, member) ((size_t)__INTADDR__(&((type *)0)->member))

#endif

/* Steps are to be quick, and the rest is to be compiled quickly. */
#define APART static __noinline__
#if HOT
#define UNROLLED _Pragma("unroll")
#define WITHIN static __forceinline__
#else
#define UNROLLED _Pragma("unroll 1")
#define WITHIN static __noinline__
#endif

/* `address_of() + T{}` is C's `&(T){}`, which lasts to the end of the whole expression here. */
struct address_of {};
template <typename T> WITHIN const T *operator+(address_of, const T &made) { return &made; }
