/* A host whose logger does not come back: arguments are a library and the location of its resources.
 *
 * After each time another thread and this one go on with the instance.
 */
#include <dlfcn.h>
#include <pthread.h>
#include <setjmp.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} callbacks;

enum { OK, DISCARD = 2, ERROR, TIMES = 50 };

static jmp_buf before;
static int told;

static void leave(void *environment, const char *name, int status, const char *category,
                  const char *text, ...) {
    (void)environment, (void)name, (void)status, (void)category, (void)text;
    told++;
    longjmp(before, 1);
}

#define FUNCTION(type, name, parameters) static type(*name) parameters
FUNCTION(void *, fmi2Instantiate,
         (const char *, int, const char *, const char *, const callbacks *, int, int));
FUNCTION(int, fmi2SetupExperiment, (void *, int, double, double, int, double));
FUNCTION(int, fmi2EnterInitializationMode, (void *));
FUNCTION(int, fmi2ExitInitializationMode, (void *));
FUNCTION(int, fmi2SetReal, (void *, const unsigned *, size_t, const double *));
FUNCTION(int, fmi2GetReal, (void *, const unsigned *, size_t, double *));
FUNCTION(int, fmi2DoStep, (void *, double, double, int));
FUNCTION(int, fmi2Reset, (void *));
FUNCTION(void, fmi2FreeInstance, (void *));

static void check(int good, const char *what) {
    if (good) return;
    fprintf(stderr, "%s\n", what);
    exit(1);
}

static void initialise(void *it) {
    check(fmi2SetupExperiment(it, 0, 0.0, 0.0, 0, 0.0) == OK, "experiment");
    check(fmi2EnterInitializationMode(it) == OK, "enter");
    check(fmi2ExitInitializationMode(it) == OK, "exit");
}

static void *get(void *it) {
    fmi2GetReal(it, NULL, 0, NULL);
    return NULL;
}

static void go_on_elsewhere(void *it) {
    pthread_t thread;
    check(pthread_create(&thread, NULL, get, it) == 0, "thread");
    check(pthread_join(thread, NULL) == 0, "thread");
}

/* Deeper than the call that the logger has left. */
static __attribute__((noinline)) void go_on(void *it) {
    volatile char below[4000];
    below[0] = 0;
    check(fmi2Reset(it) == OK, "reset");
    initialise(it);
    check(fmi2DoStep(it, 0.0, 0.02, 1) == OK + below[0], "step");
}

int main(int n, char **arguments) {
    const callbacks functions = {.logger = leave};
    check(n == 3, "leaving LIBRARY LOCATION");
    void *library = dlopen(arguments[1], RTLD_NOW | RTLD_LOCAL);
    check(library != NULL, "dlopen");
#define FIND(name) *(void **)&name = dlsym(library, #name), check(name != NULL, #name)
    FIND(fmi2Instantiate), FIND(fmi2SetupExperiment), FIND(fmi2EnterInitializationMode);
    FIND(fmi2ExitInitializationMode), FIND(fmi2SetReal), FIND(fmi2GetReal), FIND(fmi2DoStep);
    FIND(fmi2Reset), FIND(fmi2FreeInstance);
    void *it = fmi2Instantiate("it", 1, NULL, arguments[2], &functions, 0, 1);
    check(it != NULL, "no instance");
    initialise(it);
    for (volatile int i = 0; i < TIMES; i++) {
        if (setjmp(before) == 0) {
            /* Refused, or wrong: both are told. */
            if (i % 2 == 0) {
                fmi2DoStep(it, 0.0, -1.0, 1);
            } else {
                fmi2SetReal(it, NULL, 1, NULL);
            }
            check(0, "nothing was told");
        }
        go_on_elsewhere(it);
        go_on(it);
    }
    check(told == TIMES, "told otherwise");
    if (setjmp(before) == 0) fmi2SetReal(it, NULL, 1, NULL);
    fmi2FreeInstance(it);
    if (setjmp(before) == 0) {
        check(fmi2Instantiate("it", 0, NULL, arguments[2], &functions, 0, 1) == NULL, "made");
    }
    printf("left %d times\n", told);
    return 0;
}
