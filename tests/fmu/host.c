/* A host written in C: instantiates all given FMUs side by side, steps them, saves,
 * restores and serialises their state, and frees them.
 *
 * usage: host LIBRARY RESOURCES [LIBRARY RESOURCES ...]
 */
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { STEPS = 1000, MOST = 32, STATE_AT = 500, REALS = 10 };

typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *step_finished, *environment;
} callbacks;

static void log_message(void *environment, const char *instance, int status, const char *category,
                        const char *message, ...) {
    va_list arguments;
    (void)environment;
    printf("[%s] status %d, %s: ", instance, status, category);
    va_start(arguments, message);
    vprintf(message, arguments);
    va_end(arguments);
    printf("\n");
}

static void *function(void *library, const char *name) {
    void *found = dlsym(library, name);
    if (found == NULL) {
        printf("%s is missing\n", name);
        exit(2);
    }
    return found;
}

#define CALL(library, name, parameters) ((int(*) parameters)function(library, name))
#define CHECK(status)                                                                            \
    do {                                                                                         \
        int found = (status);                                                                    \
        if (found != 0) {                                                                        \
            printf("line %d: status %d\n", __LINE__, found);                                     \
            exit(3);                                                                             \
        }                                                                                        \
    } while (0)

static void step(void *library, void *c, int first, int last) {
    for (int k = first; k < last; k++)
        CHECK(CALL(library, "fmi2DoStep", (void *, double, double, int))(c, 0.02 * k, 0.02, 1));
}

/* The first Reals, inputs and outputs of every component: what a run ended with. */
static void read_all(void *library, void *c, double values[REALS]) {
    unsigned int references[REALS];
    for (unsigned int i = 0; i < REALS; i++) references[i] = i;
    CHECK(CALL(library, "fmi2GetReal", (void *, const unsigned int *, size_t, double *))(
        c, references, REALS, values));
}

int main(int n, char **arguments) {
    static callbacks functions;
    void *libraries[MOST], *instances[MOST];
    int count = (n - 1) / 2;
    functions.logger = log_message;
    functions.allocate = calloc;
    functions.release = free;
    for (int i = 0; i < count; i++) {
        libraries[i] = dlopen(arguments[1 + 2 * i], RTLD_NOW | RTLD_LOCAL);
        if (libraries[i] == NULL) {
            printf("%s\n", dlerror());
            return 1;
        }
        instances[i] = ((void *(*)(const char *, int, const char *, const char *,
                                   const callbacks *, int, int))
                            function(libraries[i], "fmi2Instantiate"))(
            "hosted", 1, "", arguments[2 + 2 * i], &functions, 0, 1);
        if (instances[i] == NULL) {
            printf("no instance\n");
            return 4;
        }
    }
    for (int i = 0; i < count; i++) {
        void *l = libraries[i], *c = instances[i], *state = NULL, *again = NULL;
        double before[REALS], after[REALS];
        size_t size = 0;
        CHECK(CALL(l, "fmi2SetupExperiment", (void *, int, double, double, int, double))(
            c, 0, 0.0, 0.0, 0, 0.0));
        CHECK(CALL(l, "fmi2EnterInitializationMode", (void *))(c));
        CHECK(CALL(l, "fmi2ExitInitializationMode", (void *))(c));
        step(l, c, 0, STATE_AT);
        CHECK(CALL(l, "fmi2GetFMUstate", (void *, void **))(c, &state));
        step(l, c, STATE_AT, STEPS);
        read_all(l, c, before);
        CHECK(CALL(l, "fmi2SerializedFMUstateSize", (void *, void *, size_t *))(c, state, &size));
        char *bytes = malloc(size);
        CHECK(CALL(l, "fmi2SerializeFMUstate", (void *, void *, char *, size_t))(
            c, state, bytes, size));
        CHECK(CALL(l, "fmi2DeSerializeFMUstate", (void *, const char *, size_t, void **))(
            c, bytes, size, &again));
        free(bytes);
        CHECK(CALL(l, "fmi2SetFMUstate", (void *, void *))(c, again));
        step(l, c, STATE_AT, STEPS);
        read_all(l, c, after);
        if (memcmp(before, after, sizeof before) != 0) {
            printf("the restored run ended elsewhere\n");
            return 5;
        }
        CHECK(CALL(l, "fmi2FreeFMUstate", (void *, void **))(c, &state));
        CHECK(CALL(l, "fmi2FreeFMUstate", (void *, void **))(c, &again));
        CHECK(CALL(l, "fmi2Terminate", (void *))(c));
    }
    for (int i = 0; i < count; i++) {
        ((void (*)(void *))function(libraries[i], "fmi2FreeInstance"))(instances[i]);
        dlclose(libraries[i]);
    }
    printf("%d FMUs, %d steps each\n", count, STEPS);
    return 0;
}
