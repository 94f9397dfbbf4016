/* Finds and starts Python, once a process.
 *
 * Each FMU has its own loader, and hosts instantiate FMUs from several threads. All loaders of a
 * process share one object: the dynamic linker resolves symbols of the type gnu_unique_object to
 * the same address in all libraries, even in those loaded with RTLD_LOCAL.
 *
 * The interpreter starts isolated: environment variables do not affect it, and it handles no signal
 * of the host. If it cannot start, the reason is logged, and the process continues. It is never
 * ended, since another FMU may be loaded later.
 */
#include <dlfcn.h>
#include <limits.h>
#include <link.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { NEWEST = 13, OLDEST = 9 };

typedef struct {
    pthread_mutex_t lock; /* for starting; never held while waiting for the interpreter lock */
    enum { UNTRIED, RUNS, FAILED } python;
    /* Guarded by the interpreter lock: */
    int making; /* number of instances that a thread makes, one within the other */
    pthread_t maker;
    pid_t family; /* process id: a forked child lacks the thread */
    message why;
} process_state;

/* The number in the name changes with the layout. Defined in assembly, because clang gives C
 * definitions another binding. Zeros mean an unlocked lock and UNTRIED. */
enum { ROOM = 4096 };
_Static_assert(sizeof(process_state) <= ROOM, "the state is larger than its room");
extern __attribute__((visibility("default"))) process_state auv_fmu_process_3;
__asm__(".pushsection .bss\n"
        ".balign 64\n"
        ".type auv_fmu_process_3, %gnu_unique_object\n"
        ".size auv_fmu_process_3, 4096\n"
        "auv_fmu_process_3: .zero 4096\n"
        ".popsection");
#define process auv_fmu_process_3

static _Atomic(void *) pythonfmu;

static const char ENDED[] = "the host has ended Python";

/* Path of PythonFMU's library, found while the loader's path is valid in the current folder. */
static char companion[PATH_MAX];

__attribute__((constructor)) static void find_companion(void) {
    static const char suffix[] = "_pythonfmu.so";
    Dl_info self;
    char folder[PATH_MAX] = "";
    if (dladdr((void *)find_companion, &self) == 0) return;
    if (self.dli_fname[0] != '/' && getcwd(folder, sizeof folder - 1) != NULL) strcat(folder, "/");
    int length = (int)(strlen(self.dli_fname) - strlen(".so"));
    int needed = snprintf(companion, sizeof companion, "%s%.*s%s", folder, length, self.dli_fname,
                          suffix);
    if (needed >= (int)sizeof companion) companion[0] = '\0';
}

static int has_python(void) { return dlsym(RTLD_DEFAULT, "Py_IsInitialized") != NULL; }

static int note_libpython(struct dl_phdr_info *info, size_t size, void *path) {
    (void)size;
    const char *name = strrchr(info->dlpi_name, '/');
    name = name == NULL ? info->dlpi_name : name + 1;
    if (strncmp(name, "libpython3.", strlen("libpython3.")) != 0) return 0;
    snprintf(path, PATH_MAX, "%s", info->dlpi_name);
    return 1;
}

static int find_python(message *why) {
    char path[PATH_MAX] = "";
    /* Make a libpython visible that the host has loaded with RTLD_LOCAL: a second one of another
     * version cannot run in the same process. */
    if (!has_python() && dl_iterate_phdr(note_libpython, path)) {
        dlopen(path, RTLD_LAZY | RTLD_NOLOAD | RTLD_GLOBAL);
    }
    for (int minor = NEWEST; minor >= OLDEST && !has_python(); minor--) {
        snprintf(path, sizeof path, "libpython3.%d.so.1.0", minor);
        dlopen(path, RTLD_LAZY | RTLD_GLOBAL);
    }
    if (!has_python()) {
        return compose(why,
                       "no Python in this process: install a libpython3.%d to libpython3.%d where "
                       "the dynamic linker finds it (Debian: apt install libpython3-dev)",
                       OLDEST, NEWEST);
    }
#define FIND(type, name, parameters)                                                             \
    py.name = (type(*) parameters)dlsym(RTLD_DEFAULT, #name);                                    \
    if (py.name == NULL) {                                                                       \
        return compose(why, "the Python of this process has no %s: it must be 3.%d to 3.%d",     \
                       #name, OLDEST, NEWEST);                                                   \
    }
    PYTHON_FUNCTIONS(FIND)
#undef FIND
    return 1;
}

/* The first fields of PyPreConfig, which are the same from 3.9 to 3.13, and room for others. */
typedef struct {
    int init, parse_argv, isolated, use_environment, configure_locale;
    int coerce_c_locale, coerce_c_locale_warn, utf8_mode;
    int others[24];
} preconfiguration;

static int succeeded(python_status status) {
    return status.type == 0 ||
           compose(&process.why, "Python does not start: %s",
                   status.message != NULL ? status.message : "no reason given");
}

static int start(void) {
    /* Without UTF-8 mode, file names would be ASCII if the host has not set a locale. */
    preconfiguration before = {0};
    py.PyPreConfig_InitIsolatedConfig(&before);
    before.utf8_mode = 1;
    if (!succeeded(py.Py_PreInitialize(&before))) return 0;

    /* PyConfig has at most 448 bytes up to 3.13. */
    max_align_t configuration[4096 / sizeof(max_align_t)] = {0};
    py.PyConfig_InitIsolatedConfig(configuration);
    int started = succeeded(py.Py_InitializeFromConfig(configuration));
    py.PyConfig_Clear(configuration);
    if (!started) return 0;

    /* This interpreter is never ended, so output of slaves must be flushed line by line. */
    py.PyRun_SimpleStringFlags(
        "import sys\nif sys.stdout: sys.stdout.reconfigure(line_buffering=True)\n", NULL);
    py.PyEval_SaveThread();
    return 1;
}

static int start_python(message *why) {
    if (process.python == UNTRIED) {
        process.python = py.Py_IsInitialized() || start() ? RUNS : FAILED;
    }
    return process.python == RUNS || compose(why, "%s", process.why.text);
}

static int load_pythonfmu(message *why) {
    void *library = companion[0] == '\0' ? NULL : dlopen(companion, RTLD_NOW | RTLD_LOCAL);
    if (library == NULL) {
        return compose(why, "cannot load PythonFMU's library: %s",
                       companion[0] == '\0' ? "its path is too long" : dlerror());
    }
    if (dlsym(library, "finalizePythonInterpreter") == NULL) {
        return compose(why, "the library next to the loader is not PythonFMU's");
    }
    pythonfmu = library;
    return 1;
}

/* Loads Python and PythonFMU into the process, unless they are loaded. */
static int load(message *why) {
    if (pythonfmu == NULL) {
        pthread_mutex_lock(&process.lock);
        (void)(pythonfmu != NULL ||
               (find_python(why) && start_python(why) && load_pythonfmu(why)));
        pthread_mutex_unlock(&process.lock);
    }
    if (pythonfmu == NULL) return 0;
    return py.Py_IsInitialized() || compose(why, "%s", ENDED);
}

static void *pythonfmu_function(string name) { return dlsym(pythonfmu, name); }

/* Releases the interpreter lock for a moment. */
static void give_way(void) {
    void *thread = py.PyEval_SaveThread();
    wait_a_moment();
    py.PyEval_RestoreThread(thread);
}

/* Waits until no other thread makes an instance of any FMU, since that changes sys.path. */
static void begin_making(void) {
    while (process.making > 0 && process.family == getpid() &&
           !pthread_equal(process.maker, pthread_self())) {
        give_way();
    }
    if (process.family != getpid()) process.making = 0;
    process.family = getpid();
    process.maker = pthread_self();
    process.making++;
}

static void end_making(void) { process.making--; }

/* Clears a Python exception and returns its message; false if none is set. */
static int take_exception(message *why) {
    void *type = NULL, *value = NULL, *trace = NULL;
    if (py.PyErr_Occurred() == NULL) return 0;
    py.PyErr_Fetch(&type, &value, &trace);
    void *words = py.PyObject_Repr(value != NULL ? value : type);
    string text = words != NULL ? py.PyUnicode_AsUTF8(words) : NULL;
    compose(why, "%s", text != NULL ? text : "an exception without a message");
    py.PyErr_Clear();
    py.Py_DecRef(words);
    py.Py_DecRef(trace);
    py.Py_DecRef(value);
    py.Py_DecRef(type);
    return 1;
}

/* preflight.py checks that PythonFMU can make an instance; otherwise PythonFMU ends the process. */

enum { FILE_INPUT = 257 };

extern const char source[] __attribute__((visibility("hidden")));
__asm__(".pushsection .rodata\n"
        "source: .incbin \"preflight.py\"\n"
        ".byte 0\n"
        ".popsection\n");

/* Returns a function of preflight.py, or NULL with an exception set. */
static void *function(string name) {
    static void *namespace;
    if (namespace == NULL) {
        void *fresh = py.PyDict_New();
        void *done =
            fresh == NULL ? NULL : py.PyRun_StringFlags(source, FILE_INPUT, fresh, fresh, NULL);
        if (done == NULL) {
            py.Py_DecRef(fresh);
            return NULL;
        }
        py.Py_DecRef(done);
        namespace = fresh;
    }
    return py.PyDict_GetItemString(namespace, name);
}

static int preflight(string resources, string guid, message *why) {
    void *refusal = function("refusal");
    void *words = refusal == NULL
                      ? NULL
                      : py.PyObject_CallFunction(refusal, "ss", resources, guid != NULL ? guid : "");
    string text = words == NULL ? NULL : py.PyUnicode_AsUTF8(words);
    int good = text != NULL && text[0] == '\0';
    if (text != NULL && !good) {
        compose(why, "%s", text);
    } else if (text == NULL && !take_exception(why)) {
        compose(why, "the loader is broken");
    }
    py.Py_DecRef(words);
    return good;
}

/* Removes a resources folder from sys.path, where PythonFMU leaves it. */
static void forget(string resources) {
    message unused;
    void *forget = function("forget");
    if (forget != NULL) py.Py_DecRef(py.PyObject_CallFunction(forget, "s", resources));
    take_exception(&unused);
}
