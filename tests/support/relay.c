/* An FMI 2.0 slave that a few lines of Python can be: see relay.py.

   g = a u + c holds from the beginning of a step on, the state x, shown as y, is integrated over
   it. It logs every step, with a warning, as long as debug logging is on. */

#include <stdlib.h>
#include <string.h>

#include "slave.h"

enum { U, V, G, Y, T, H, A, C, PORTS };

typedef struct {
    double values[PORTS];
    int logging;
    const Callbacks *callbacks;
} Instance;

static void respond(Instance *it) { it->values[G] = it->values[A] * it->values[U] + it->values[C]; }

static void say(Instance *it, const char *what)
{
    if (it->logging)
        it->callbacks->logger(it->callbacks->environment, "relay", Warning, "chatter", what);
}

Status fmi2SetDebugLogging(Component c, int on, size_t n, const char *const *categories)
{
    ((Instance *)c)->logging = on;
    return OK;
}

Component fmi2Instantiate(const char *name, int type, const char *guid, const char *location,
                          const Callbacks *callbacks, int visible, int logging)
{
    Instance *it = calloc(1, sizeof *it);
    it->callbacks = callbacks;
    it->logging = logging;
    return it;
}

Status fmi2SetupExperiment(Component c, int tolerance, double t, double start, int stop, double end)
{
    ((Instance *)c)->values[T] = start;
    return OK;
}

Status fmi2EnterInitializationMode(Component c)
{
    say(c, "initialises");
    return OK;
}

Status fmi2SetReal(Component c, const unsigned *r, size_t n, const double *values)
{
    size_t i;
    for (i = 0; i < n; i++) ((Instance *)c)->values[r[i]] = values[i];
    respond(c);
    return OK;
}

Status fmi2GetReal(Component c, const unsigned *r, size_t n, double *values)
{
    size_t i;
    for (i = 0; i < n; i++) values[i] = ((Instance *)c)->values[r[i]];
    return OK;
}

Status fmi2DoStep(Component c, double t, double h, int no_rollback)
{
    double *is = ((Instance *)c)->values;
    say(c, "steps");
    respond(c);
    is[Y] += h * (is[U] - is[V]);
    is[T] = t;
    is[H] = h;
    return OK;
}
