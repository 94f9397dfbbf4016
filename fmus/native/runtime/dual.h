/* Dual numbers: values, each with its derivative in one direction.
 *
 * Values are computed as in arithmetic.h, bit for bit. At a kink the branch that the value takes is
 * differentiated. A constant has the derivative 0, whatever the slope of its function.
 */
#ifndef DUAL_H
#define DUAL_H

#include "arithmetic.h"

typedef struct {
    double v, d; /* value and derivative */
} Dual;

/* A number that does not change. */
static inline Dual dual_fixed(double v) { return (Dual){v, 0.0}; }

/* The chain rule; slopes may be infinite. */
static inline double dual_chain(double slope, double d) { return d == 0.0 ? 0.0 : slope * d; }

static inline Dual dual_add(Dual a, Dual b) { return (Dual){a.v + b.v, a.d + b.d}; }
static inline Dual dual_sub(Dual a, Dual b) { return (Dual){a.v - b.v, a.d - b.d}; }
static inline Dual dual_neg(Dual a) { return (Dual){-a.v, -a.d}; }
static inline Dual dual_mul(Dual a, Dual b) { return (Dual){a.v * b.v, a.d * b.v + a.v * b.d}; }

static inline Dual dual_over(Dual a, Dual b) {
    double z = a.v / b.v;
    return (Dual){z, (a.d - z * b.d) / b.v};
}

static inline Dual dual_div(Dual a, Dual b, Error *error) {
    double z = py_div(a.v, b.v, error);
    return (Dual){z, (a.d - z * b.d) / b.v};
}

static inline Dual dual_pow_whole(Dual x, Dual y, Error *error) {
    double slope = y.v == 0.0 ? 0.0 : y.v * pow(x.v, y.v - 1.0);
    return (Dual){py_pow(x.v, y.v, error), dual_chain(slope, x.d)};
}

static inline Dual dual_mod(Dual x, Dual y, Error *error) {
    return (Dual){py_mod(x.v, y.v, error), x.d + dual_chain(-floor(x.v / y.v), y.d)};
}

static inline Dual dual_floordiv(Dual x, Dual y, Error *error) {
    return dual_fixed(py_floordiv(x.v, y.v, error));
}

static inline Dual dual_nearest(Dual x) { return dual_fixed(nearest(x.v)); }
static inline Dual dual_smaller(Dual a, Dual b) { return b.v < a.v ? b : a; }
static inline Dual dual_larger(Dual a, Dual b) { return b.v > a.v ? b : a; }

#endif
