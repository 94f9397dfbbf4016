/* Python's arithmetic.
 *
 * Where Python raises, the equations go on with what C gives, and the first error is noted: nothing
 * that is computed after it is used. The upper-case names stand where Python has the operator or
 * the function of the same name, in functions that have an `error`.
 */
#ifndef ARITHMETIC_H
#define ARITHMETIC_H

/* Each operation is rounded separately, as in Python, whatever flags an importer compiles with. */
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__) && defined(__FP_FAST_FMA)
#pragma GCC optimize("fp-contract=off")
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif

#include <math.h>
#include <stdarg.h>
#include <stdio.h>

/* Bytes of the text of an error. */
enum { WHY = 512 };

typedef struct {
    int raised;
    char why[WHY]; /* the exception's class and text, or only the text of a refusal */
} Error;

static void raise_error(Error *error, const char *format, ...) {
    va_list arguments;
    if (error->raised) return;
    error->raised = 1;
    va_start(arguments, format);
    vsnprintf(error->why, sizeof error->why, format, arguments);
    va_end(arguments);
}

/* A number for a text: Python's NaN has no sign. */
static inline double shown(double x) { return isnan(x) ? fabs(x) : x; }

static void raise_domain_error(Error *error) { raise_error(error, "ValueError: math domain error"); }

static inline double quotient(double a, double b, Error *error) {
    if (b == 0.0) raise_error(error, "ZeroDivisionError: float division by zero");
    return a / b;
}

static inline double square_root(double x, Error *error) {
    if (x < 0.0) raise_domain_error(error);
    return sqrt(x);
}

static inline double cosine(double x, Error *error) {
    if (isinf(x)) raise_domain_error(error);
    return cos(x);
}

static inline double sine(double x, Error *error) {
    if (isinf(x)) raise_domain_error(error);
    return sin(x);
}

static inline double arcsine(double x, Error *error) {
    if (x < -1.0 || x > 1.0) raise_domain_error(error);
    return asin(x);
}

static inline double exponential(double x, Error *error) {
    double y = exp(x);
    if (isinf(y) && !isinf(x)) raise_error(error, "OverflowError: math range error");
    return y;
}

static inline double exponential_m1(double x, Error *error) {
    double y = expm1(x);
    if (isinf(y) && !isinf(x)) raise_error(error, "OverflowError: math range error");
    return y;
}

static inline double logarithm(double x, Error *error) {
    if (x <= 0.0) raise_domain_error(error);
    return log(x);
}

static inline double logarithm_1p(double x, Error *error) {
    if (x <= -1.0) raise_domain_error(error);
    return log1p(x);
}

/* A place in an array of n elements; negative ones count from its end. */
static inline int place_in(int i, int n, Error *error) {
    if (i >= 0 && i < n) return i;
    if (i < 0 && i >= -n) return i + n;
    raise_error(error, "IndexError: tuple index out of range");
    return 0;
}

#define PLACE(i, n) place_in(i, n, error)
#define DIV(a, b) quotient(a, b, error)
#define SQRT(x) square_root(x, error)
#define COS(x) cosine(x, error)
#define SIN(x) sine(x, error)
#define ASIN(x) arcsine(x, error)
#define EXP(x) exponential(x, error)
#define EXPM1(x) exponential_m1(x, error)
#define LOG(x) logarithm(x, error)
#define LOG1P(x) logarithm_1p(x, error)

#endif
