/* A host in C: makes an instance of an FMU, uses it, frees it, again and
 * again, and prints the cycles and the resident memory [pages] after each of some numbers of them.
 *
 * usage: cycles LIBRARY RESOURCES CYCLES [CYCLES ...]
 */
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>

typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *step_finished, *environment;
} callbacks;

static void keep_quiet(void *environment, const char *instance, int status, const char *category,
                       const char *message, ...) {
    (void)environment, (void)instance, (void)status, (void)category, (void)message;
}

static void *library;

static void *function(const char *name) {
    void *found = dlsym(library, name);
    if (found == NULL) exit(2);
    return found;
}

static void succeed(int status) {
    if (status != 0) exit(3);
}

#define CALL(name, parameters) ((int(*) parameters)function(name))

static void use_state(void *c) {
    void *state = NULL, *again = NULL;
    size_t size = 0;
    succeed(CALL("fmi2GetFMUstate", (void *, void **))(c, &state));
    succeed(CALL("fmi2SerializedFMUstateSize", (void *, void *, size_t *))(c, state, &size));
    char *bytes = malloc(size);
    succeed(CALL("fmi2SerializeFMUstate", (void *, void *, char *, size_t))(c, state, bytes, size));
    succeed(CALL("fmi2DeSerializeFMUstate", (void *, const char *, size_t, void **))(
        c, bytes, size, &again));
    free(bytes);
    succeed(CALL("fmi2SetFMUstate", (void *, void *))(c, again));
    succeed(CALL("fmi2FreeFMUstate", (void *, void **))(c, &state));
    succeed(CALL("fmi2FreeFMUstate", (void *, void **))(c, &again));
}

static void cycle(const char *resources) {
    static const callbacks functions = {keep_quiet, calloc, free, NULL, NULL};
    void *(*instantiate)(const char *, int, const char *, const char *, const void *, int, int) =
        function("fmi2Instantiate");
    void *c = instantiate("cycling", 1, "", resources, &functions, 0, 0);
    if (c == NULL) exit(4);
    succeed(CALL("fmi2SetupExperiment", (void *, int, double, double, int, double))(
        c, 0, 0.0, 0.0, 0, 0.0));
    succeed(CALL("fmi2EnterInitializationMode", (void *))(c));
    succeed(CALL("fmi2ExitInitializationMode", (void *))(c));
    succeed(CALL("fmi2DoStep", (void *, double, double, int))(c, 0.0, 0.02, 1));
    use_state(c);
    succeed(CALL("fmi2Reset", (void *))(c));
    ((void (*)(void *))function("fmi2FreeInstance"))(c);
}

static long resident(void) {
    long size = 0, pages = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    if (file == NULL || fscanf(file, "%ld %ld", &size, &pages) != 2) exit(5);
    fclose(file);
    return pages;
}

int main(int n, char **arguments) {
    long done = 0;
    library = dlopen(arguments[1], RTLD_NOW | RTLD_LOCAL);
    if (library == NULL) return 1;
    for (int i = 3; i < n; i++) {
        for (; done < atol(arguments[i]); done++) cycle(arguments[2]);
        printf("%ld %ld\n", done, resident());
        fflush(stdout);
    }
    return 0;
}
