/* A linear system as an FMI 2.0 slave: see linear.py.

   x' = A x + B u, y = C x + D u, with two states, inputs and outputs, exact for inputs that change
   linearly. With CACHED its outputs are computed in steps only. */

#include <stdlib.h>
#include <string.h>

#include "slave.h"

/* Value references: inputs, outputs, then parameters. */
enum { U = 0, Y = 2, A = 4, B = 8, C = 12, D = 16, X0 = 20, PORTS = 22 };
enum { N = 2, TERMS = 40 };

typedef struct {
    double values[PORTS], x[N], slopes[N];
    int stepping;
} Instance;

static void respond(Instance *it)
{
    double *v = it->values;
    int i;
    for (i = 0; i < N; i++)
        v[Y + i] = v[C + N * i] * it->x[0] + v[C + N * i + 1] * it->x[1] +
                   v[D + N * i] * v[U] + v[D + N * i + 1] * v[U + 1];
}

Component fmi2Instantiate(const char *name, int type, const char *guid, const char *location,
                          const Callbacks *callbacks, int visible, int logging)
{
    return calloc(1, sizeof(Instance));
}

Status fmi2EnterInitializationMode(Component c)
{
    Instance *it = c;
    memcpy(it->x, it->values + X0, sizeof it->x);
    return OK;
}

Status fmi2ExitInitializationMode(Component c)
{
    respond(c);
    ((Instance *)c)->stepping = 1;
    return OK;
}

Status fmi2Reset(Component c)
{
    memset(c, 0, sizeof(Instance));
    return OK;
}

Status fmi2SetReal(Component c, const unsigned *r, size_t n, const double *values)
{
    size_t i;
    for (i = 0; i < n; i++) {
        ((Instance *)c)->values[r[i]] = values[i];
#ifdef FORGETS
        if (r[i] < Y) ((Instance *)c)->slopes[r[i] - U] = 0.0;
#endif
    }
    return OK;
}

Status fmi2GetReal(Component c, const unsigned *r, size_t n, double *values)
{
    Instance *it = c;
    size_t i;
    if (!it->stepping) memcpy(it->x, it->values + X0, sizeof it->x);
#ifdef CACHED
    if (!it->stepping)
#endif
        respond(it);
    for (i = 0; i < n; i++) values[i] = it->values[r[i]];
    return OK;
}

Status fmi2SetRealInputDerivatives(Component c, const unsigned *r, size_t n, const int *orders,
                                   const double *values)
{
    size_t i;
    for (i = 0; i < n; i++) {
        if (orders[i] != 1) return Error;
        ((Instance *)c)->slopes[r[i] - U] = values[i];
    }
    return OK;
}

Status fmi2GetDirectionalDerivative(Component c, const unsigned *unknowns, size_t n,
                                    const unsigned *knowns, size_t m, const double *seeds,
                                    double *found)
{
    size_t i, j;
    for (i = 0; i < n; i++) {
        found[i] = 0.0;
        for (j = 0; j < m; j++)
            found[i] += ((Instance *)c)->values[D + N * (unknowns[i] - Y) + knowns[j] - U] * seeds[j];
    }
    return OK;
}

Status fmi2GetFMUstate(Component c, void **state)
{
    if (*state == NULL) *state = malloc(sizeof(Instance));
    memcpy(*state, c, sizeof(Instance));
    return OK;
}

Status fmi2SetFMUstate(Component c, void *state)
{
    memcpy(c, state, sizeof(Instance));
    return OK;
}

STATE_IS(Instance)

/* The exponential series of the states with the inputs and their slopes after them. */
Status fmi2DoStep(Component c, double t, double h, int no_rollback)
{
    Instance *it = c;
    double *v = it->values;
    double term[3][N], next[3][N];
    int i, k;
    memcpy(term[0], it->x, sizeof term[0]);
    memcpy(term[1], v + U, sizeof term[1]);
    memcpy(term[2], it->slopes, sizeof term[2]);
    for (k = 1; k < TERMS; k++) {
        for (i = 0; i < N; i++) {
            next[0][i] = v[A + N * i] * term[0][0] + v[A + N * i + 1] * term[0][1] +
                         v[B + N * i] * term[1][0] + v[B + N * i + 1] * term[1][1];
            next[1][i] = term[2][i];
            next[2][i] = 0.0;
        }
        for (i = 0; i < N; i++) {
            term[0][i] = next[0][i] * h / k;
            term[1][i] = next[1][i] * h / k;
            term[2][i] = 0.0;
            it->x[i] += term[0][i];
            v[U + i] += term[1][i];
        }
    }
    respond(it);
    return OK;
}
