/* Functions of a C library, the same for every compiler and machine: they only add, multiply,
 * divide and take roots, which IEEE 754 rounds in one way. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>

#define LN_2 0.69314718055994531
#define HALF_PI 1.5707963267948966

static double same_expm1(double x) {
    /* Small steps of exp(x) - 1, put together by e^(a+a) - 1 = (e^a - 1) (e^a - 1 + 2). */
    double a = x / 1024.0, sum = 0.0;
    for (int n = 12; n > 0; n--) sum = a / n * (1.0 + sum);
    for (int i = 0; i < 10; i++) sum *= sum + 2.0;
    return sum;
}

static double same_exp(double x) { return same_expm1(x) + 1.0; }

static double same_tanh(double x) {
    if (fabs(x) > 20.0) return x > 0.0 ? 1.0 : -1.0;
    double t = same_expm1(2.0 * x);
    return t / (t + 2.0);
}

static double same_log(double x) {
    int n;
    double m = frexp(x, &n), y = 0.0;
    for (int i = 0; i < 6; i++) y += 2.0 * (m - same_exp(y)) / (m + same_exp(y));
    return y + n * LN_2;
}

/* Square root of a number that is at least zero. */
static double same_pow(double x, double y) {
    return x > 0.0 ? same_exp(y * same_log(x)) : y > 0.0 ? 0.0 : 1.0;
}

static double series(double x, double first, int n) {
    double sum = first;
    for (; n > 0; n -= 2) sum = 1.0 - x * x / (n * (n + 1.0)) * sum;
    return sum;
}

static double quarter(double x, int turned) {
    double n = floor(x / HALF_PI + 0.5), r = x - n * HALF_PI;
    int q = (int)(n - 4.0 * floor(n / 4.0)) + turned;
    double value = q % 2 ? series(r, 1.0, 19) : r * series(r, 1.0, 20);
    return q % 4 < 2 ? value : -value;
}

static double same_sin(double x) { return quarter(x, 0); }
static double same_cos(double x) { return quarter(x, 1); }

static double same_atan(double x) {
    double sum = 0.0;
    for (int i = 0; i < 4; i++) x /= 1.0 + sqrt(1.0 + x * x);
    for (int n = 25; n > 0; n -= 2) sum = 1.0 / n - x * x * sum;
    return 16.0 * x * sum;
}

static double same_atan2(double y, double x) {
    if (x == 0.0 && y == 0.0) return 0.0;
    if (fabs(x) < fabs(y)) return (y > 0.0 ? HALF_PI : -HALF_PI) - same_atan(x / y);
    return same_atan(y / x) + (x > 0.0 ? 0.0 : y < 0.0 ? -2.0 * HALF_PI : 2.0 * HALF_PI);
}

static double same_asin(double x) { return same_atan2(x, sqrt(1.0 - x * x)); }

#define asin same_asin
#define atan same_atan
#define atan2 same_atan2
#define cos same_cos
#define exp same_exp
#define expm1 same_expm1
#define log same_log
#define pow same_pow
#define sin same_sin
#define tanh same_tanh
