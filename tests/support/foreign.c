/* An FMI 2.0 slave that is not ours, and misbehaves as its parameters say: see foreign.py.

   y = t + u, until in the phase `phase`, and for steps from t = `at` on, `act` happens. After
   fmi2Fatal every further call, on whichever instance, ends the process: FMI forbids it. */

#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "slave.h"

enum { ENTER, EXIT, STEP, TERMINATE, FREE };
enum {
    BEHAVE, NOT_A_NUMBER, INFINITE, SILENT_ERROR, FATAL, EXITS, CRASHES, HANGS, SPINS,
    KILLED, WRITES, LOGS, LEAVES_A_PROCESS, CLOSES_ALL, ANSWERS_ITSELF, SIGNALS,
    ALARMS, FORKS, CLOSES_FILES, MOVES, ESCAPES,
};
enum { U, Y, AT, ACT, PHASE, VARIABLES };

typedef struct {
    double values[VARIABLES];
    double time;
    double excess;
    const char *name;
    const Callbacks *callbacks;
} Instance;

static int dead;

static Status act(Instance *instance, int phase)
{
    if (dead) {
        fputs("called after fmi2Fatal\n", stderr);
        abort();
    }
    if (instance->values[PHASE] != phase || (phase == STEP && instance->time < instance->values[AT]))
        return OK;
    switch ((int)instance->values[ACT]) {
    case NOT_A_NUMBER:
        instance->excess = NAN;
        break;
    case INFINITE:
        instance->excess = -INFINITY;
        break;
    case SILENT_ERROR:
        return Error;
    case FATAL:
        dead = 1;
        instance->callbacks->logger(instance->callbacks->environment, instance->name, Fatal, NULL,
                                    "beyond %s", "repair");
        return Fatal;
    case EXITS:
        exit(3);
    case CRASHES:
        *(volatile int *)NULL = 1;
        break;
    case HANGS:
        fputs("hangs\n", stderr);
        for (;;)
            pause();
    case SPINS:
        for (;;)
            ;
    case KILLED:
        kill(getpid(), SIGKILL);
        break;
    case SIGNALS:
        kill(getpid(), 40);
        break;
    case WRITES:
        for (int i = 0; i < 100000; i++)
            puts("to be or not to be, that is the question");
        fflush(stdout);
        break;
    case LOGS:
        for (int i = 0; i < 1000; i++)
            instance->callbacks->logger(instance->callbacks->environment, instance->name, Warning,
                                        "", "%d: %0500d", i, i);
        break;
    case LEAVES_A_PROCESS:
        if (fork() == 0)
            for (;;)
                pause();
        abort();
    case CLOSES_ALL:
        for (int descriptor = 0; descriptor < 64; descriptor++)
            close(descriptor);
        break;
    case ALARMS:
        raise(SIGALRM);
        break;
    case FORKS:
        if (fork())
            wait(NULL);
        break;
    case CLOSES_FILES:
        for (int descriptor = 3; descriptor < 64; descriptor++)
            close(descriptor);
        break;
    case MOVES:
        if (chdir("/"))
            return Error;
        break;
    case ESCAPES:
        fputs("\033]0;owned\007 gr\303\274n\n\r\302\233", stderr);
        break;
    case ANSWERS_ITSELF:
        for (int descriptor = 3; descriptor < 64; descriptor++)
            if (write(descriptor, "nonsense, nonsense, nonsense, nonsense", 38) < 0)
                continue;
        break;
    }
    return OK;
}

Component fmi2Instantiate(const char *name, int type, const char *guid, const char *location,
                          const Callbacks *callbacks, int visible, int logging)
{
    const char *wanted = getenv("FOREIGN_INSTANTIATE");
    if (wanted && !strcmp(wanted, "hangs"))
        for (;;)
            pause();
    if (wanted && !strcmp(wanted, "crashes"))
        abort();
    if (wanted && !strcmp(wanted, "refuses"))
        return NULL;
    Instance *instance = calloc(1, sizeof *instance);
    instance->name = strdup(name);
    instance->callbacks = callbacks;
    return instance;
}

void fmi2FreeInstance(Component c)
{
    act(c, FREE);
    free(c);
}

Status fmi2EnterInitializationMode(Component c) { return act(c, ENTER); }
Status fmi2ExitInitializationMode(Component c) { return act(c, EXIT); }
Status fmi2Terminate(Component c) { return act(c, TERMINATE); }
Status fmi2GetReal(Component c, const unsigned *r, size_t n, double *values)
{
    Instance *instance = c;
    instance->values[Y] = instance->time + instance->values[U] + instance->excess;
    for (size_t i = 0; i < n; i++)
        values[i] = instance->values[r[i]];
    return OK;
}

Status fmi2SetReal(Component c, const unsigned *r, size_t n, const double *values)
{
    for (size_t i = 0; i < n; i++)
        ((Instance *)c)->values[r[i]] = values[i];
    return OK;
}

Status fmi2GetInteger(Component c, const unsigned *r, size_t n, int *values)
{
    for (size_t i = 0; i < n; i++)
        values[i] = (int)((Instance *)c)->values[r[i]];
    return OK;
}

Status fmi2SetInteger(Component c, const unsigned *r, size_t n, const int *values)
{
    for (size_t i = 0; i < n; i++)
        ((Instance *)c)->values[r[i]] = values[i];
    return OK;
}

Status fmi2DoStep(Component c, double t, double h, int no_rollback)
{
    Instance *instance = c;
    instance->time = t;
    Status status = act(instance, STEP);
    instance->time = t + h;
    return status;
}
