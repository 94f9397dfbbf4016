/* Lets a PythonFMU FMU run in a host that is no Python program.
 *
 * PythonFMU's library needs Python's symbols and does not bring them. This library takes its place
 * under the FMU's model identifier. It looks whether the process has Python's symbols, otherwise
 * loads a libpython for everybody to see, then loads PythonFMU's own library, which stands beside
 * it as <model identifier>_pythonfmu.so, and forwards every FMI call to it.
 *
 * It also mends two faults of PythonFMU 0.7 that only a library can mend: it decodes the
 * percent-encoded resource location, and it ends PythonFMU's watch over the interpreter before the
 * process does, which otherwise frees it twice.
 *
 * FMI calls of one FMU do not overlap while it is being instantiated, so nothing is locked.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <link.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))

enum { FMI2_ERROR = 3, FMI2_FATAL = 4 };

typedef void *component;
typedef const char *string;
typedef unsigned int reference;

/* fmi2CallbackFunctions, of which only the logger is used here. */
typedef struct {
    void (*logger)(void *, string, int, string, string, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} callbacks;

static void *pythonfmu;

static void complain(const callbacks *functions, string instance, string what, string why) {
    if (functions != NULL && functions->logger != NULL) {
        functions->logger(functions->environment, instance, FMI2_ERROR, "logStatusError",
                          "%s: %s", what, why);
    } else {
        fprintf(stderr, "%s: %s: %s\n", instance, what, why);
    }
}

/* A libpython that the host has loaded for itself alone is made visible: a second one of another
 * version in the same process would not do. */
static int promote(struct dl_phdr_info *info, size_t size, void *done) {
    (void)size;
    const char *name = strrchr(info->dlpi_name, '/');
    name = name == NULL ? info->dlpi_name : name + 1;
    if (strncmp(name, "libpython3.", 11) == 0) {
        *(int *)done = dlopen(info->dlpi_name, RTLD_LAZY | RTLD_NOLOAD | RTLD_GLOBAL) != NULL;
    }
    return *(int *)done;
}

static int has_python(void) { return dlsym(RTLD_DEFAULT, "Py_IsInitialized") != NULL; }

static int find_python(void) {
    int promoted = 0;
    if (has_python()) return 1;
    dl_iterate_phdr(promote, &promoted);
    for (int minor = 13; minor >= 9 && !has_python(); minor--) {
        char name[32];
        snprintf(name, sizeof name, "libpython3.%d.so.1.0", minor);
        dlopen(name, RTLD_LAZY | RTLD_GLOBAL);
    }
    return has_python();
}

/* An interpreter that PythonFMU starts would take file names for ASCII where the host has set no
 * locale. */
static void read_names_as_utf8(void) {
    int (*is_initialized)(void) = (int (*)(void))dlsym(RTLD_DEFAULT, "Py_IsInitialized");
    int *utf8_mode = dlsym(RTLD_DEFAULT, "Py_UTF8Mode");
    if (utf8_mode != NULL && !is_initialized()) *utf8_mode = 1;
}

static void release_interpreter(void) {
    void (*release)(void) = (void (*)(void))dlsym(pythonfmu, "finalizePythonInterpreter");
    if (release != NULL) release();
}

static int load(const callbacks *functions, string instance) {
    static const char suffix[] = "_pythonfmu.so";
    Dl_info self;
    char path[4096];
    if (pythonfmu != NULL) return 1;
    if (!find_python()) {
        complain(functions, instance, "no Python in this process",
                 "install a libpython3.9 to libpython3.13 where the dynamic linker finds it "
                 "(Debian: apt install libpython3-dev)");
        return 0;
    }
    if (dladdr((void *)load, &self) == 0 ||
        strlen(self.dli_fname) + sizeof suffix > sizeof path) {
        complain(functions, instance, "cannot tell where this FMU is", "path too long");
        return 0;
    }
    strcpy(path, self.dli_fname);
    strcpy(path + strlen(path) - strlen(".so"), suffix);
    pythonfmu = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (pythonfmu == NULL) {
        complain(functions, instance, "cannot load PythonFMU's library", dlerror());
        return 0;
    }
    read_names_as_utf8();
    /* Registered after that library's own destructors, and therefore run before them. */
    atexit(release_interpreter);
    return 1;
}

static int hex(char digit) {
    if (digit >= '0' && digit <= '9') return digit - '0';
    digit |= 0x20;
    return digit >= 'a' && digit <= 'f' ? digit - 'a' + 10 : -1;
}

/* file:///a%20b or file:/a%20b as the plain path /a b, which PythonFMU takes as it is. */
static char *plain_path(string uri) {
    char *path = malloc(strlen(uri) + 1), *end = path;
    if (path == NULL) return NULL;
    if (strncmp(uri, "file://", 7) == 0) {
        uri = strchr(uri + 7, '/') != NULL ? strchr(uri + 7, '/') : uri + 7;
    } else if (strncmp(uri, "file:", 5) == 0) {
        uri += 5;
    }
    while (*uri != '\0') {
        if (uri[0] == '%' && hex(uri[1]) >= 0 && hex(uri[2]) >= 0) {
            *end++ = (char)(16 * hex(uri[1]) + hex(uri[2]));
            uri += 3;
        } else {
            *end++ = *uri++;
        }
    }
    *end = '\0';
    return path;
}

EXPORT string fmi2GetTypesPlatform(void) { return "default"; }

EXPORT string fmi2GetVersion(void) { return "2.0"; }

EXPORT component fmi2Instantiate(string name, int type, string guid, string location,
                                 const callbacks *functions, int visible, int logging) {
    typedef component (*instantiate)(string, int, string, string, const callbacks *, int, int);
    component made = NULL;
    if (location == NULL || !load(functions, name)) return NULL;
    instantiate forward = (instantiate)dlsym(pythonfmu, "fmi2Instantiate");
    char *path = plain_path(location);
    if (forward != NULL && path != NULL) {
        made = forward(name, type, guid, path, functions, visible, logging);
    }
    free(path);
    return made;
}

EXPORT void fmi2FreeInstance(component c) {
    void (*forward)(component) =
        pythonfmu == NULL ? NULL : (void (*)(component))dlsym(pythonfmu, "fmi2FreeInstance");
    if (forward != NULL && c != NULL) forward(c);
}

/* Every other function has a status and is forwarded as it is. */
#define FORWARD(name, parameters, arguments)                                                     \
    EXPORT int name parameters {                                                                 \
        static int(*forward) parameters;                                                         \
        if (forward == NULL && pythonfmu != NULL) {                                              \
            forward = (int(*) parameters)dlsym(pythonfmu, #name);                                \
        }                                                                                        \
        return forward == NULL ? FMI2_FATAL : forward arguments;                                 \
    }

FORWARD(fmi2SetDebugLogging, (component c, int on, size_t n, const string names[]),
        (c, on, n, names))
FORWARD(fmi2SetupExperiment,
        (component c, int has_tolerance, double tolerance, double start, int has_stop, double stop),
        (c, has_tolerance, tolerance, start, has_stop, stop))
FORWARD(fmi2EnterInitializationMode, (component c), (c))
FORWARD(fmi2ExitInitializationMode, (component c), (c))
FORWARD(fmi2Terminate, (component c), (c))
FORWARD(fmi2Reset, (component c), (c))
FORWARD(fmi2GetReal, (component c, const reference r[], size_t n, double v[]), (c, r, n, v))
FORWARD(fmi2GetInteger, (component c, const reference r[], size_t n, int v[]), (c, r, n, v))
FORWARD(fmi2GetBoolean, (component c, const reference r[], size_t n, int v[]), (c, r, n, v))
FORWARD(fmi2GetString, (component c, const reference r[], size_t n, string v[]), (c, r, n, v))
FORWARD(fmi2SetReal, (component c, const reference r[], size_t n, const double v[]), (c, r, n, v))
FORWARD(fmi2SetInteger, (component c, const reference r[], size_t n, const int v[]), (c, r, n, v))
FORWARD(fmi2SetBoolean, (component c, const reference r[], size_t n, const int v[]), (c, r, n, v))
FORWARD(fmi2SetString, (component c, const reference r[], size_t n, const string v[]),
        (c, r, n, v))
FORWARD(fmi2GetFMUstate, (component c, void **state), (c, state))
FORWARD(fmi2SetFMUstate, (component c, void *state), (c, state))
FORWARD(fmi2FreeFMUstate, (component c, void **state), (c, state))
FORWARD(fmi2SerializedFMUstateSize, (component c, void *state, size_t *size), (c, state, size))
FORWARD(fmi2SerializeFMUstate, (component c, void *state, char bytes[], size_t size),
        (c, state, bytes, size))
FORWARD(fmi2DeSerializeFMUstate, (component c, const char bytes[], size_t size, void **state),
        (c, bytes, size, state))
FORWARD(fmi2GetDirectionalDerivative,
        (component c, const reference u[], size_t nu, const reference k[], size_t nk,
         const double dk[], double du[]),
        (c, u, nu, k, nk, dk, du))
FORWARD(fmi2SetRealInputDerivatives,
        (component c, const reference r[], size_t n, const int order[], const double v[]),
        (c, r, n, order, v))
FORWARD(fmi2GetRealOutputDerivatives,
        (component c, const reference r[], size_t n, const int order[], double v[]),
        (c, r, n, order, v))
FORWARD(fmi2DoStep, (component c, double time, double step, int no_set), (c, time, step, no_set))
FORWARD(fmi2CancelStep, (component c), (c))
FORWARD(fmi2GetStatus, (component c, int kind, int *v), (c, kind, v))
FORWARD(fmi2GetRealStatus, (component c, int kind, double *v), (c, kind, v))
FORWARD(fmi2GetIntegerStatus, (component c, int kind, int *v), (c, kind, v))
FORWARD(fmi2GetBooleanStatus, (component c, int kind, int *v), (c, kind, v))
FORWARD(fmi2GetStringStatus, (component c, int kind, string *v), (c, kind, v))
