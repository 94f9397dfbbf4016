/* A host that runs Python itself and ends it before it lets its instance go, as one does whose
 * libraries are unloaded in the order of their names.
 *
 * usage: ending LIBPYTHON LIBRARY RESOURCES
 */
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>

static void *library;

static void *checked(void *pointer, const char *what) {
    if (pointer == NULL) {
        fprintf(stderr, "%s: NULL\n", what);
        exit(2);
    }
    return pointer;
}

#define FUNCTION(from, name, result, parameters)                                                 \
    ((result(*) parameters)checked(dlsym(from, name), name))
#define CALL(name, parameters) FUNCTION(library, name, int, parameters)

static void *instantiate(const char *resources) {
    return FUNCTION(library, "fmi2Instantiate", void *,
                    (const char *, int, const char *, const char *, const void *, int, int))(
        "ended", 1, "", resources, NULL, 0, 0);
}

static int step(void *c) {
    return CALL("fmi2DoStep", (void *, double, double, int))(c, 0.0, 0.02, 1);
}

int main(int n, char **arguments) {
    if (n != 4) return 2;
    void *python = checked(dlopen(arguments[1], RTLD_NOW | RTLD_GLOBAL), arguments[1]);
    FUNCTION(python, "Py_InitializeEx", void, (int))(0);
    library = checked(dlopen(arguments[2], RTLD_NOW | RTLD_LOCAL), arguments[2]);
    void *c = checked(instantiate(arguments[3]), "instance"), *state = NULL;
    int status = CALL("fmi2EnterInitializationMode", (void *))(c);
    status |= CALL("fmi2ExitInitializationMode", (void *))(c);
    status |= CALL("fmi2GetFMUstate", (void *, void **))(c, &state);
    printf("with Python %d\n", status | step(c));
    printf("ended %d\n", FUNCTION(python, "Py_FinalizeEx", int, (void))());
    printf("step %d\n", step(c));
    printf("free state %d\n", CALL("fmi2FreeFMUstate", (void *, void **))(c, &state));
    printf("another %s\n", instantiate(arguments[3]) == NULL ? "none" : "made");
    fprintf(stderr, "--\n");
    printf("terminate %d\n", CALL("fmi2Terminate", (void *))(c));
    FUNCTION(library, "fmi2FreeInstance", void, (void *))(c);
    dlclose(library);
    return 0;
}
