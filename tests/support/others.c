/* An FMI 2.0 slave as other tools make them: see others.py.

   y = gain u, plus the sum of its steps times 1 + u where it ends at a time, and every other output
   is the input of its kind. What is peculiar about it says how it is compiled. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "mode.h"
#include "slave.h"

/* Called in every function. */
static void change_mode(void)
{
#ifdef CHANGES_MODE
    fesetround(FE_UPWARD);
    flush_to_zero();
#endif
}

__attribute__((constructor)) static void loaded(void) { change_mode(); }
__attribute__((destructor)) static void unloaded(void) { change_mode(); }

/* Value references, of variables of any kind. */
enum { U, Y, GAIN, STUBBORN, DERIVED, VARIABLES };
enum { PENDING = 5 };

static const double reals[VARIABLES] = {101325.0, 0.0, 1.0, 1.0, 1.0};

typedef struct {
    double reals[VARIABLES];
    int integers[VARIABLES];
    int booleans[VARIABLES];
    char texts[VARIABLES][1000];
    double time, step, end, sum;
    int asked, steps;
    const char *name;
    const Callbacks *callbacks;
} Instance;

Status fmi2SetDebugLogging(Component c, int on, size_t n, const char *const *categories)
{
    change_mode();
    return OK;
}

Component fmi2Instantiate(const char *name, int type, const char *guid, const char *location,
                          const Callbacks *callbacks, int visible, int logging)
{
#ifdef ONCE
    static int used;
    if (used++)
        return NULL;
#endif
    Instance *it = calloc(1, sizeof *it);
    memcpy(it->reals, reals, sizeof reals);
#ifdef REMEMBERS
    static int before;
    it->reals[GAIN] += before++;
#endif
    change_mode();
    strcpy(it->texts[U], "start");
    it->integers[U] = 1;
    it->name = strdup(name);
    it->callbacks = callbacks;
    return it;
}

void fmi2FreeInstance(Component c)
{
    change_mode();
    free(c);
}

Status fmi2SetupExperiment(Component c, int tolerance, double t, double start, int stop, double end)
{
    change_mode();
    ((Instance *)c)->end = stop ? end : HUGE_VAL;
    return OK;
}

Status fmi2EnterInitializationMode(Component c)
{
    change_mode();
#ifdef RESETS
    memcpy(((Instance *)c)->reals, reals, sizeof reals);
#endif
    return OK;
}

Status fmi2ExitInitializationMode(Component c)
{
    change_mode();
#ifdef CHATTERS
    Instance *it = c;
    for (int i = 0; i < 200; i++)
        it->callbacks->logger(NULL, it->name, Warning, "", "%s %d", "chatter", i);
    it->callbacks->logger(it->callbacks->environment, it->name, Error, NULL, "%s", "alarming");
#endif
    return OK;
}

Status fmi2Terminate(Component c)
{
    change_mode();
    return OK;
}

#define ACCESS(kind, type, values_of) \
    Status fmi2Set##kind(Component c, const unsigned *r, size_t n, const type *values) \
    { \
        for (size_t i = 0; i < n; i++) \
            if (r[i] != STUBBORN) \
                ((Instance *)c)->values_of[r[i]] = values[i]; \
        change_mode(); \
        return OK; \
    } \
    Status fmi2Get##kind(Component c, const unsigned *r, size_t n, type *values) \
    { \
        Instance *it = c; \
        it->values_of[Y] = it->values_of[U]; \
        it->reals[Y] = it->reals[GAIN] * it->reals[U] + it->sum; \
        for (size_t i = 0; i < n; i++) \
            values[i] = it->values_of[r[i]]; \
        change_mode(); \
        return OK; \
    }
ACCESS(Real, double, reals)
ACCESS(Integer, int, integers)
ACCESS(Boolean, int, booleans)

Status fmi2SetString(Component c, const unsigned *r, size_t n, const char *const *values)
{
    for (size_t i = 0; i < n; i++)
        strcpy(((Instance *)c)->texts[r[i]], values[i]);
    return OK;
}

/* The returned texts are good until the next call. */
Status fmi2GetString(Component c, const unsigned *r, size_t n, const char **values)
{
    Instance *it = c;
#if defined SPEAKS || defined FORGETS
    if (it->steps)
        snprintf(it->texts[Y], sizeof it->texts[Y], "%s%d %s", it->name, it->steps, it->texts[U]);
    else
#endif
        strcpy(it->texts[Y], it->texts[U]);
    for (size_t i = 0; i < n; i++)
        values[i] = it->texts[r[i]];
    return OK;
}

Status fmi2DoStep(Component c, double t, double h, int no_rollback)
{
    Instance *it = c;
    it->time = t;
#ifdef ENDS_AT
    it->time = t + h < ENDS_AT ? t + h : ENDS_AT;
    it->sum += (it->time - t) * (1.0 + it->reals[U]);
    if (t + h > ENDS_AT - 1e-9)
        return Discard;
#endif
    if (t + h > it->end)
        return Error;
#ifdef RIGID
    if (it->step && (h < 0.999 * it->step || h > 1.001 * it->step))
        return Error;
#endif
    it->step = h;
    it->steps++;
    change_mode();
#ifdef WAITS
    it->asked = 0;
    return PENDING;
#endif
    return OK;
}

/* A state is a copy; who forgets does not take the number of its steps from it. */
Status fmi2GetFMUstate(Component c, void **state)
{
    *state = memcpy(malloc(sizeof(Instance)), c, sizeof(Instance));
    return OK;
}

Status fmi2SetFMUstate(Component c, void *state)
{
    Instance *it = c, own = *it;
    memcpy(it, state, sizeof *it);
    it->name = own.name;
    it->callbacks = own.callbacks;
#ifdef FORGETS
    it->steps = own.steps;
#endif
    return OK;
}

#ifdef LACKS
#define fmi2DeSerializeFMUstate not_there
#endif
STATE_IS(Instance)

Status fmi2GetStatus(Component c, int kind, Status *value)
{
    *value = ((Instance *)c)->asked++ < 2 ? PENDING : OK;
    return OK;
}

Status fmi2GetBooleanStatus(Component c, int kind, int *value)
{
    *value = kind == 3;
    return OK;
}

Status fmi2GetRealStatus(Component c, int kind, double *value)
{
#ifdef ENDS_AT
    *value = ((Instance *)c)->time;
#else
    *value = 0.5;
#endif
    return OK;
}
