/* A host whose threads instantiate an FMU each at the same moment, step it and free it.
 *
 * usage: threads LIBRARY RESOURCES [LIBRARY RESOURCES ...]
 */
#include <dlfcn.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>

enum { STEPS = 20, MOST = 16 };

typedef struct {
    const char *library, *resources;
    pthread_t thread;
} job;

static pthread_barrier_t together;

static void *checked(void *pointer, const char *what) {
    if (pointer == NULL) {
        printf("%s\n", what);
        exit(2);
    }
    return pointer;
}

#define CALL(name, parameters) ((int(*) parameters)checked(dlsym(library, name), name))

static void *run(void *arguments) {
    job *it = arguments;
    void *(*instantiate)(const char *, int, const char *, const char *, const void *, int, int);
    void *library = checked(dlopen(it->library, RTLD_NOW | RTLD_LOCAL), "no library");
    instantiate = checked(dlsym(library, "fmi2Instantiate"), "fmi2Instantiate");
    pthread_barrier_wait(&together);
    void *c = checked(instantiate("threaded", 1, "", it->resources, NULL, 0, 0), "no instance");
    int failed = CALL("fmi2SetupExperiment", (void *, int, double, double, int, double))(
        c, 0, 0.0, 0.0, 0, 0.0);
    failed |= CALL("fmi2EnterInitializationMode", (void *))(c);
    failed |= CALL("fmi2ExitInitializationMode", (void *))(c);
    for (int k = 0; k < STEPS; k++) {
        failed |= CALL("fmi2DoStep", (void *, double, double, int))(c, 0.02 * k, 0.02, 1);
    }
    ((void (*)(void *))checked(dlsym(library, "fmi2FreeInstance"), "free"))(c);
    return checked(failed ? NULL : it, "a call failed");
}

int main(int n, char **arguments) {
    static job jobs[MOST];
    int count = (n - 1) / 2;
    pthread_barrier_init(&together, NULL, (unsigned int)count);
    for (int i = 0; i < count; i++) {
        jobs[i] = (job){.library = arguments[1 + 2 * i], .resources = arguments[2 + 2 * i]};
        pthread_create(&jobs[i].thread, NULL, run, &jobs[i]);
    }
    for (int i = 0; i < count; i++) pthread_join(jobs[i].thread, NULL);
    printf("%d threads\n", count);
    return 0;
}
