/* An FMI 2.0 slave with ports of all kinds: see mixed.py.

   In every step its state, a number and a word of bits, is stirred with time and inputs, and all
   outputs follow from it. In step `at` it does what `act` says, in the call that `call` says. */

#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "mode.h"
#include "slave.h"

/* Inputs come first, outputs after them, and parameters last. */
enum { PORTS = 64, OUTPUTS = 24, AT = 60, ACT, CALL, MILLISECONDS };
enum { SET, STEP, GET };
enum {
    BEHAVE, WARN, DISCARD, FAIL, FATAL, NOT_A_NUMBER, INFINITE, SAYS, INTERRUPT, HANGS,
    BELOW_ALL, BEYOND_ALL, ROUNDS, FLUSHES,
};

typedef struct {
    double reals[PORTS];
    int integers[PORTS];
    int booleans[PORTS];
    double state;
    unsigned bits;
    int steps;
    const char *name;
    const Callbacks *callbacks;
} Instance;

static Status act(Instance *it, int call)
{
    struct timespec pause_of = {0, 1000000L * it->integers[MILLISECONDS]};
    if (call == STEP && it->integers[MILLISECONDS])
        nanosleep(&pause_of, NULL);
    if (it->steps != it->integers[AT] || it->integers[CALL] != call)
        return OK;
    switch (it->integers[ACT]) {
    case WARN:
        return Warning;
    case DISCARD:
        return Discard;
    case FAIL:
        return Error;
    case FATAL:
        return Fatal;
    case NOT_A_NUMBER:
        it->state = NAN;
        break;
    case INFINITE:
        it->state = INFINITY;
        break;
    case SAYS:
        it->callbacks->logger(it->callbacks->environment, it->name, Warning, "", "step %d", it->steps);
        it->callbacks->logger(it->callbacks->environment, it->name, Discard, "", "tired");
        return Discard;
    case INTERRUPT:
        kill(getpid(), SIGINT);
        break;
    case BELOW_ALL:
        return -1;
    case BEYOND_ALL:
        return 6;
    case ROUNDS:
        fesetround(FE_UPWARD);
        break;
    case FLUSHES:
        flush_to_zero();
        break;
    case HANGS:
        for (;;)
            pause();
    }
    return OK;
}

static void respond(Instance *it)
{
    for (int i = OUTPUTS; i < AT; i++) {
        it->reals[i] = it->state * i;
        it->integers[i] = (int)(it->bits >> (i % 7)) - 1000;
        it->booleans[i] = it->bits >> i % 32 & 1;
    }
}

Component fmi2Instantiate(const char *name, int type, const char *guid, const char *location,
                          const Callbacks *callbacks, int visible, int logging)
{
    Instance *it = calloc(1, sizeof *it);
    it->name = strdup(name);
    it->callbacks = callbacks;
    it->state = 0.25;
    it->bits = 12345;
    it->integers[AT] = -1;
    respond(it);
    return it;
}

/* The parameters are set before the first step, so the first call is theirs and must not fail. */
#define SETTER(name, type, values_of) \
    Status fmi2Set##name(Component c, const unsigned *r, size_t n, const type *values) \
    { \
        for (size_t i = 0; i < n; i++) \
            ((Instance *)c)->values_of[r[i]] = values[i]; \
        return ((Instance *)c)->steps ? act(c, SET) : OK; \
    }
#define GETTER(name, type, values_of) \
    Status fmi2Get##name(Component c, const unsigned *r, size_t n, type *values) \
    { \
        for (size_t i = 0; i < n; i++) \
            values[i] = ((Instance *)c)->values_of[r[i]]; \
        return ((Instance *)c)->steps ? act(c, GET) : OK; \
    }
SETTER(Real, double, reals)
SETTER(Integer, int, integers)
SETTER(Boolean, int, booleans)
GETTER(Real, double, reals)
GETTER(Integer, int, integers)
GETTER(Boolean, int, booleans)

Status fmi2DoStep(Component c, double t, double h, int no_rollback)
{
    Instance *it = c;
    Status status;
    it->steps++;
    it->state = 0.5 * it->state + 0.125 * t - h;
    for (int i = 0; i < OUTPUTS; i++) {
        it->state += 1e-3 * it->reals[i] / (1 + i);
        it->bits = 1664525u * it->bits + 1013904223u + (unsigned)it->integers[i] +
                   (unsigned)(it->booleans[i] << i);
    }
    status = act(it, STEP);
    respond(it);
    return status;
}
