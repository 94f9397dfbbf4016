/* Ways for slaves to change the floating-point mode of the process. */

#include <fenv.h>

#ifdef __SSE__
#include <xmmintrin.h>
static void flush_to_zero(void) { _mm_setcsr(_mm_getcsr() | 0x8040); }
#else
static void flush_to_zero(void) {}
#endif
