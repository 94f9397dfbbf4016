/* An FMI 2.0 slave whose output y follows its input u in the same moment: see test_hosts.py. x is the
   integral of u, and t the time. */

#include "slave.h"

enum { U, Y, X, T, PORTS };

Component fmi2Instantiate(const char *name, int type, const char *guid, const char *location,
                          const Callbacks *callbacks, int visible, int logging)
{
    return calloc(PORTS, sizeof(double));
}

Status fmi2SetReal(Component c, const unsigned *r, size_t n, const double *values)
{
    double *is = c;
    size_t i;
    for (i = 0; i < n; i++) is[r[i]] = values[i];
    is[Y] = is[U];
    return OK;
}

Status fmi2GetReal(Component c, const unsigned *r, size_t n, double *values)
{
    size_t i;
    for (i = 0; i < n; i++) values[i] = ((double *)c)[r[i]];
    return OK;
}

Status fmi2DoStep(Component c, double t, double h, int no_rollback)
{
    double *is = c;
    is[X] += h * is[U];
    is[T] = t + h;
    return OK;
}
