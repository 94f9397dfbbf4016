/* Finds Python and starts it, once a process.
 *
 * Each FMU has its own loader, and hosts instantiate FMUs from several threads. What all
 * loaders of a process share is one object: the dynamic linker makes symbols of the type
 * gnu_unique_object the same for all libraries, even the ones loaded only for themselves.
 *
 * The interpreter starts isolated: no variable of the environment changes how it starts, and it
 * takes no signal from the host. A start that fails ends in a reason, not in the end of the
 * process. It is never ended: another FMU may come.
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
    pthread_mutex_t lock; /* for starting; the interpreter lock is never waited for under it */
    enum { UNTRIED, RUNS, FAILED } python;
    /* Under the interpreter lock: */
    int making; /* how many instances a thread makes, one within the other */
    pthread_t maker;
    pid_t family; /* the process that it is in: a child that is forked lacks the thread */
    message why;
} process_state;

/* The name carries a number, which another layout raises. Defined without C, because clang gives
 * what C defines another binding. Zeros are a lock that is free, and UNTRIED. */
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

/* PythonFMU's own library, found while the current folder is that in which this one was. */
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
    /* A libpython that the host has loaded only for itself is made visible: a second one of
     * another version in the same process would not do. */
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

/* The first fields of PyPreConfig, which are the same from 3.9 to 3.13, and room for more. */
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
    /* Without UTF-8 mode, file names would be taken for ASCII where the host has set no locale. */
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

    /* Nobody will end this interpreter, and flush what slaves have printed. */
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

/* Brings Python and PythonFMU into the process, if they are not. */
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

/* Lets other threads have the interpreter lock for a while. */
static void give_way(void) {
    void *thread = py.PyEval_SaveThread();
    wait_a_moment();
    py.PyEval_RestoreThread(thread);
}

/* Waits until no other thread makes an instance, of any FMU, which changes sys.path. */
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

/* Whether a Python exception is set, in words; it is set no longer. */
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

/* preflight.py finds out whether PythonFMU can make an instance: it would end the process. */

enum { FILE_INPUT = 257 };

extern const char source[] __attribute__((visibility("hidden")));
__asm__(".pushsection .rodata\n"
        "source: .incbin \"preflight.py\"\n"
        ".byte 0\n"
        ".popsection\n");

/* A function of preflight.py; NULL with an exception set. */
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

/* Takes a resources folder off sys.path, where PythonFMU leaves it. */
static void forget(string resources) {
    message unused;
    void *forget = function("forget");
    if (forget != NULL) py.Py_DecRef(py.PyObject_CallFunction(forget, "s", resources));
    take_exception(&unused);
}
