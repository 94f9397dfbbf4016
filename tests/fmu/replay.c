/* A host written in C: gives an FMU the inputs of a run that others have made, and
 * writes its outputs.
 *
 * usage: replay LIBRARY GUID RESOURCES < WHAT
 *
 * Read are the step, and how many there are; how many values are set before the start, and of each
 * the letter of its type, R, I or B, its reference and itself; how many inputs, outputs, and all
 * their references; the inputs at the start, and after each step. Written is a line of outputs for
 * each of these times.
 */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#ifdef _WIN32
#include <windows.h>
#define OPEN(path) ((void *)LoadLibraryA(path))
#define FIND(library, name) ((void *)GetProcAddress((HMODULE)(library), name))
#else
#include <dlfcn.h>
#define OPEN(path) dlopen(path, RTLD_NOW | RTLD_LOCAL)
#define FIND(library, name) dlsym(library, name)
#endif

enum { MOST = 1000, CO_SIMULATION = 1 };

typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *step_finished, *environment;
} callbacks;

static void *library;

static void fail(const char *what) {
    fprintf(stderr, "%s\n", what);
    exit(1);
}

static void log_message(void *environment, const char *instance, int status, const char *category,
                        const char *message, ...) {
    va_list arguments;
    (void)environment;
    fprintf(stderr, "%s, status %d, %s: ", instance, status, category);
    va_start(arguments, message);
    vfprintf(stderr, message, arguments);
    va_end(arguments);
}

static void *function(const char *name) {
    void *found = FIND(library, name);
    if (found == NULL) fail(name);
    return found;
}

#define CALL(name, parameters, ...)                                                              \
    do {                                                                                         \
        int(*called) parameters;                                                                 \
        *(void **)&called = function(name);                                                      \
        if (called(__VA_ARGS__) != 0) fail(name);                                                \
    } while (0)

static double number(void) {
    double found;
    if (scanf("%lf", &found) != 1) fail("a number is missing");
    return found;
}

static int count(void) {
    int found;
    if (scanf("%d", &found) != 1 || found < 0 || found > MOST) fail("a count is missing");
    return found;
}

static void set(void *instance, char type, unsigned reference, double value) {
    int whole = (int)value;
    if (type == 'R') {
        CALL("fmi2SetReal", (void *, const unsigned *, size_t, const double *), instance,
             &reference, 1, &value);
    } else {
        CALL(type == 'B' ? "fmi2SetBoolean" : "fmi2SetInteger",
             (void *, const unsigned *, size_t, const int *), instance, &reference, 1, &whole);
    }
}

int main(int n, char **arguments) {
    static callbacks functions = {log_message, calloc, free, NULL, NULL};
    static unsigned inputs[MOST], outputs[MOST];
    static double values[MOST];
    void *(*instantiate)(const char *, int, const char *, const char *, const callbacks *, int, int);
    void (*release)(void *);
    void *it;
    if (n != 4) fail("usage: replay LIBRARY GUID RESOURCES");
    library = OPEN(arguments[1]);
    if (library == NULL) fail("the library cannot be loaded");
    *(void **)&instantiate = function("fmi2Instantiate");
    it = instantiate("replayed", CO_SIMULATION, arguments[2], arguments[3], &functions, 0, 1);
    if (it == NULL) fail("no instance");

    const double step = number();
    const long steps = (long)number();
    for (int i = count(); i > 0; i--) {
        char type;
        if (scanf(" %c", &type) != 1) fail("a type is missing");
        const unsigned reference = (unsigned)number();
        set(it, type, reference, number());
    }
    const int n_inputs = count(), n_outputs = count();
    for (int i = 0; i < n_inputs; i++) inputs[i] = (unsigned)number();
    for (int i = 0; i < n_outputs; i++) outputs[i] = (unsigned)number();

    CALL("fmi2SetupExperiment", (void *, int, double, double, int, double), it, 0, 0.0, 0.0, 0, 0.0);
    CALL("fmi2EnterInitializationMode", (void *), it);
    for (long k = 0; k <= steps; k++) {
        for (int i = 0; i < n_inputs; i++) set(it, 'R', inputs[i], number());
        if (k == 0) CALL("fmi2ExitInitializationMode", (void *), it);
        CALL("fmi2GetReal", (void *, const unsigned *, size_t, double *), it, outputs,
             (size_t)n_outputs, values);
        for (int i = 0; i < n_outputs; i++) printf("%.17g ", values[i]);
        printf("\n");
        if (k < steps) {
            CALL("fmi2DoStep", (void *, double, double, int), it, (double)k * step, step, 1);
        }
    }
    CALL("fmi2Terminate", (void *), it);
    *(void **)&release = function("fmi2FreeInstance");
    release(it);
    return 0;
}
