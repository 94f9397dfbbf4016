/* A host that calls whatever comes into its mind, right and wrong, in any order.
 *
 * usage: random_calls LIBRARY RESOURCES SEED CALLS
 *
 * Right arguments are exactly as large as they have to be, so that a sanitizer sees every byte too
 * much that is read or written.
 */
#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PLACES = 4, KINDS = 4, RARELY = 100 };
enum { ERROR = 3, FATAL = 4 };

typedef void *handle;

static void *library;
static const char *resources;
static uint64_t number;
static handle instances[PLACES], states[PLACES];
static long told;

static unsigned int below(unsigned int limit) {
    number = number * 6364136223846793005u + 1442695040888963407u;
    return (unsigned int)(number >> 33) % limit;
}

static int once_in(unsigned int times) { return below(times) == 0; }

static void listen(void *environment, const char *instance, int status, const char *category,
                   const char *message, ...) {
    (void)environment;
    (void)status;
    told += (long)(strlen(instance) + strlen(category) + strlen(message));
}

static void *function(const char *prefix, const char *kind) {
    char name[64];
    snprintf(name, sizeof name, "fmi2%s%s", prefix, kind);
    void *found = dlsym(library, name);
    if (found == NULL) {
        printf("%s is missing\n", name);
        exit(2);
    }
    return found;
}

#define CALL(prefix, kind, parameters) ((int(*) parameters)function(prefix, kind))

/* A handle of a table, or something that is none. */
static handle some(handle table[PLACES]) {
    static int somewhere;
    if (!once_in(RARELY)) return table[below(PLACES)];
    switch (below(4)) {
        case 0: return NULL;
        case 1: return &somewhere;
        case 2: return (handle)(uintptr_t)number;
        default: return (char *)table[below(PLACES)] + 1;
    }
}

/* NULL instead of something, now and then. */
static void *maybe(void *pointer) { return once_in(RARELY) ? NULL : pointer; }

static const char *text(void) {
    static const char *const good[] = {"tanh", "", "%n%s%", "gr\xc3\xbc\xc3\x9f"};
    static const char *const bad[] = {"x\xff", "\xed\xa0\x80", NULL};
    return once_in(RARELY) ? bad[below(3)] : good[below(4)];
}

static void instantiate(void) {
    static struct {
        void (*logger)(void *, const char *, int, const char *, const char *, ...);
        void *others[4];
    } callbacks = {.logger = listen}, none;
    handle *place = &instances[below(PLACES)];
    void *(*make)(const char *, int, const char *, const char *, const void *, int, int) =
        function("Instantiate", "");
    ((void (*)(handle))function("FreeInstance", ""))(*place);
    /* States end with their instance. */
    if (!once_in(RARELY)) memset(states, 0, sizeof states);
    const char *folder = once_in(RARELY) ? text() : resources;
    *place = make(text(), !once_in(RARELY), once_in(RARELY) ? text() : NULL, folder,
                  maybe(once_in(10) ? &none : &callbacks), 0, !once_in(4));
}

static int values(handle c) {
    static const char *const kinds[KINDS] = {"Real", "Integer", "Boolean", "String"};
    static const size_t sizes[KINDS] = {sizeof(double), sizeof(int), sizeof(int), sizeof(char *)};
    unsigned int kind = below(KINDS), n = below(4);
    size_t stated = once_in(RARELY) ? (size_t)1 << (31 + below(33)) : n;
    unsigned int *references = malloc(n * sizeof *references);
    char *array = calloc(n, sizes[kind]);
    for (unsigned int i = 0; i < n; i++) {
        references[i] = once_in(10) ? (unsigned int)number : below(60);
        if (kind == KINDS - 1) ((const char **)array)[i] = text();
    }
    int status = CALL(once_in(2) ? "Get" : "Set", kinds[kind],
                      (handle, const unsigned int *, size_t, void *))(
        c, maybe(references), stated, maybe(array));
    free(references);
    free(array);
    return status;
}

/* A word of a state becomes another one, and its checksum fits again. */
static void tamper(unsigned char *bytes, size_t n) {
    static const uint32_t odd[] = {0, 1, 2, 5, 0x7fffffff, 0x80000000, 0x7ff00000, 0xfff80000};
    uint32_t sum = 0xffffffff, word = odd[below(sizeof odd / sizeof *odd)];
    if (n < 64) return;
    memcpy(bytes + n - 4 * (2 + below((unsigned int)n / 4 - 2)), &word, sizeof word);
    for (size_t i = 0; i < n - 4; i++) {
        sum ^= bytes[i];
        for (int k = 0; k < 8; k++) sum = (sum >> 1) ^ ((sum & 1) ? 0xedb88320u : 0);
    }
    sum = ~sum;
    memcpy(bytes + n - 4, &sum, sizeof sum);
}

static int state(handle c) {
    handle *place = &states[below(PLACES)];
    handle one = *place == NULL || once_in(RARELY) ? some(states) : *place;
    size_t size = 0;
    switch (*place == NULL ? 0 : below(6)) {
        case 0: return CALL("GetFMUstate", "", (handle, handle *))(c, maybe(place));
        case 1: return CALL("SetFMUstate", "", (handle, handle))(c, one);
        case 2: return CALL("FreeFMUstate", "", (handle, handle *))(c, maybe(place));
        case 3: return once_in(RARELY) ? CALL("FreeFMUstate", "", (handle, handle *))(c, &one) : 0;
        default: break;
    }
    int status = CALL("SerializedFMUstateSize", "", (handle, handle, size_t *))(c, one, &size);
    size += status == 0 && once_in(RARELY) ? 1 - 2 * below(2) : 0;
    char *bytes = malloc(size + (status != 0));
    if (CALL("SerializeFMUstate", "", (handle, handle, char *, size_t))(c, one, bytes, size) == 0) {
        if (once_in(4)) tamper((unsigned char *)bytes, size);
        status = CALL("DeSerializeFMUstate", "", (handle, const char *, size_t, handle *))(
            c, maybe(bytes), once_in(RARELY) ? 0 : size, maybe(place));
    }
    free(bytes);
    return status;
}

static int mode(handle c) {
    static const char *const names[] = {"EnterInitializationMode", "ExitInitializationMode",
                                        "Reset", "Reset", "Terminate", "CancelStep",
                                        "EnterEventMode", "EnterContinuousTimeMode"};
    if (once_in(3)) {
        return CALL("SetupExperiment", "", (handle, int, double, double, int, double))(
            c, 0, 0.0, 0.0, 0, 0.0);
    }
    return CALL(names[below(sizeof names / sizeof *names)], "", (handle))(c);
}

static int query(handle c) {
    static const char *const kinds[] = {"", "Real", "Integer", "Boolean", "String"};
    const char *categories[] = {text(), text()};
    char name[32];
    double value[2];
    if (once_in(2)) {
        return CALL("SetDebugLogging", "", (handle, int, size_t, const char *const *))(
            c, (int)below(2), below(3), maybe(categories));
    }
    snprintf(name, sizeof name, "%sStatus", kinds[below(sizeof kinds / sizeof *kinds)]);
    return CALL("Get", name, (handle, int, void *))(c, (int)below(5), maybe(value));
}

int main(int n, char **arguments) {
    long counts[FATAL + 1] = {0};
    if (n != 5) return 2;
    library = dlopen(arguments[1], RTLD_NOW | RTLD_LOCAL);
    resources = arguments[2];
    number = strtoull(arguments[3], NULL, 10);
    for (long left = atol(arguments[4]); left > 0; left--) {
        handle c = some(instances);
        int status = 0;
        switch (below(12)) {
            case 0:
                if (once_in(5)) instantiate();
                break;
            case 1:
                if (once_in(RARELY)) ((void (*)(handle))function("FreeInstance", ""))(c);
                break;
            case 2: case 3: status = mode(c); break;
            case 4: case 5: status = state(c); break;
            case 6: status = query(c); break;
            case 7: case 8: case 9: status = values(c); break;
            default:
                status = CALL("DoStep", "", (handle, double, double, int))(c, 0.0, 0.02, 1);
        }
        if (status < 0 || status > FATAL) return 3;
        counts[status]++;
    }
    printf("ok %ld, discard %ld, error %ld, fatal %ld, told %ld\n", counts[0], counts[2],
           counts[ERROR], counts[FATAL], told);
    return 0;
}
