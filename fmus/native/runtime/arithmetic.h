/* Python's arithmetic.
 *
 * If Python would raise an exception, the first error is noted, the equations continue with the
 * result of C, and later results are not used. Functions of math that raise are defined next to the
 * equations.
 */
#ifndef ARITHMETIC_H
#define ARITHMETIC_H

#if defined(__FAST_MATH__) || defined(_M_FP_FAST)
#error "Compile without -ffast-math and /fp:fast, which change numbers."
#endif

/* Each operation is rounded separately, as in Python: compilers must not contract operations. */
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__) && defined(__FP_FAST_FMA)
#pragma GCC optimize("fp-contract=off")
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif

#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "error.h"

/* Texts of errors. */
#define DOMAIN_ERROR "ValueError: math domain error"
#define RANGE_ERROR "OverflowError: math range error"

static inline double py_div(double a, double b, Error *error) {
    raise_if(b == 0.0, error, "ZeroDivisionError: float division by zero");
    return a / b;
}

/* An infinite result for a finite argument is out of range. */
static inline double bounded_result(double x, double y, Error *error) {
    raise_if(isinf(y) && !isinf(x), error, RANGE_ERROR);
    return y;
}

static inline double math_pow(double x, double y, Error *error) {
    double z = pow(x, y);
    if (isfinite(x) && isfinite(y) && !isfinite(z)) {
        raise_if(isnan(z) || x == 0.0, error, DOMAIN_ERROR);
        raise_error(error, RANGE_ERROR);
    }
    return z;
}

/* Python's x ** y for a whole y; for another y Python's result may be complex. */
static inline double py_pow(double x, double y, Error *error) {
    double z = pow(x, y);
    if (x == 0.0 && y < 0.0)
        raise_error(error, "ZeroDivisionError: 0.0 cannot be raised to a negative power");
    else if (isinf(z) && isfinite(x))
        raise_error(error, "OverflowError: (34, 'Numerical result out of range')");
    return z;
}

static inline double math_fmod(double x, double y, Error *error) {
    double z = isinf(y) && !isinf(x) ? x : fmod(x, y);
    raise_if(isnan(z) && !isnan(x) && !isnan(y), error, DOMAIN_ERROR);
    return z;
}

/* Python's x % y: it has the sign of y. */
static inline double py_mod(double x, double y, Error *error) {
    double z;
    if (y == 0.0) {
        raise_error(error, "ZeroDivisionError: float modulo");
        return x;
    }
    z = fmod(x, y);
    if (z == 0.0) return copysign(0.0, y);
    return (y < 0.0) != (z < 0.0) ? z + y : z;
}

/* Python's x // y. */
static inline double py_floordiv(double x, double y, Error *error) {
    double z, n, whole;
    if (y == 0.0) {
        raise_error(error, "ZeroDivisionError: float floor division by zero");
        return x;
    }
    z = fmod(x, y);
    n = (x - z) / y;
    if (z != 0.0 && (y < 0.0) != (z < 0.0)) n -= 1.0;
    if (n == 0.0) return copysign(0.0, x / y);
    whole = floor(n);
    return n - whole > 0.5 ? whole + 1.0 : whole;
}

/* Integers of 32 bits; a larger result is an error, while Python's integers have no limit. */

static inline int integer(long long k, Error *error) {
    if (k >= INT_MIN && k <= INT_MAX) return (int)k;
    raise_error(error, "OverflowError: an integer exceeds 32 bits");
    return 0;
}

/* Converts a float without a fraction to an integer. */
static inline int int_of(double x, Error *error) {
    if (x >= INT_MIN && x <= INT_MAX) return (int)x;
    raise_error(error, isnan(x)   ? "ValueError: cannot convert float NaN to integer"
                       : isinf(x) ? "OverflowError: cannot convert float infinity to integer"
                                  : "OverflowError: an integer exceeds 32 bits");
    return 0;
}

static inline int int_add(int a, int b, Error *error) { return integer((long long)a + b, error); }
static inline int int_sub(int a, int b, Error *error) { return integer((long long)a - b, error); }
static inline int int_mul(int a, int b, Error *error) { return integer((long long)a * b, error); }
static inline int int_neg(int k, Error *error) { return integer(-(long long)k, error); }

static inline long long magnitude(long long k) { return k < 0 ? -k : k; }
static inline int int_abs(int k, Error *error) { return integer(magnitude(k), error); }

/* Python's k ** n for n >= 0. */
static inline int int_pow(int k, int n, Error *error) {
    long long z = 1;
    if (magnitude(k) < 2 && n > 2) n = 2 - n % 2; /* only whether it is odd matters */
    for (; n > 0 && magnitude(z) <= INT_MAX; n--) z *= k;
    return integer(n > 0 ? LLONG_MAX : z, error);
}

static inline double int_div(int a, int b, Error *error) {
    raise_if(b == 0, error, "ZeroDivisionError: division by zero");
    return (double)a / b;
}

static inline int int_floordiv(int a, int b, Error *error) {
    long long n;
    if (b == 0) {
        raise_error(error, "ZeroDivisionError: integer division or modulo by zero");
        return 0;
    }
    n = (long long)a / b;
    return integer(n * b != a && (a < 0) != (b < 0) ? n - 1 : n, error);
}

static inline int int_mod(int a, int b, Error *error) {
    long long z;
    if (b == 0) {
        raise_error(error, "ZeroDivisionError: integer modulo by zero");
        return 0;
    }
    z = (long long)a % b;
    return (int)(z != 0 && (z < 0) != (b < 0) ? z + b : z);
}

/* Python's min and max: the first argument, unless the second is smaller or larger. */
static inline double smaller(double a, double b) { return b < a ? b : a; }
static inline double larger(double a, double b) { return b > a ? b : a; }
static inline int smaller_int(int a, int b) { return b < a ? b : a; }
static inline int larger_int(int a, int b) { return b > a ? b : a; }

/* Rounds to the nearest integer, and halves to the even one. */
static inline double nearest(double x) {
    double y = round(x);
    return fabs(x - y) == 0.5 ? 2.0 * round(x / 2.0) : y;
}

/* Returns an index into an array of n elements; negative indices count from its end. */
static inline int place_in(int i, int n, Error *error) {
    if (i >= 0 && i < n) return i;
    if (i < 0 && i >= -n) return i + n;
    raise_error(error, "IndexError: tuple index out of range");
    return 0;
}

#endif
