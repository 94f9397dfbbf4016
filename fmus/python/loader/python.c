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

/* Between two looks whether another thread is done [us]. */
enum { WAIT = 100 };

typedef struct {
    pthread_mutex_t lock; /* for starting; the interpreter lock is never waited for under it */
    enum { UNTRIED, RUNS, FAILED } python;
    /* Under the interpreter lock: */
    uint64_t serial; /* of the last handle */
    int making;      /* how many instances a thread makes, one within the other */
    pthread_t maker;
    pid_t family; /* the process that it is in: a child that is forked lacks the thread */
    char why[WHY];
} process_state;

/* The name carries a number, which another layout raises. Defined without C, because clang gives
 * what C defines another binding. Zeros are a lock that is free, and UNTRIED. */
enum { ROOM = 4096 };
_Static_assert(sizeof(process_state) <= ROOM, "the state is larger than its room");
extern __attribute__((visibility("default"))) process_state auv_fmu_process_2;
__asm__(".pushsection .bss\n"
        ".balign 64\n"
        ".type auv_fmu_process_2, %gnu_unique_object\n"
        ".size auv_fmu_process_2, 4096\n"
        "auv_fmu_process_2: .zero 4096\n"
        ".popsection");
#define process auv_fmu_process_2

python_functions py;

static _Atomic(void *) pythonfmu;

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

static int find_python(char *why) {
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
        snprintf(why, WHY,
                 "no Python in this process: install a libpython3.%d to libpython3.%d where the "
                 "dynamic linker finds it (Debian: apt install libpython3-dev)",
                 OLDEST, NEWEST);
        return 0;
    }
#define FIND(type, name, parameters)                                                             \
    py.name = (type(*) parameters)dlsym(RTLD_DEFAULT, #name);                                    \
    if (py.name == NULL) {                                                                       \
        snprintf(why, WHY, "the Python of this process has no %s: it must be 3.%d to 3.%d",      \
                 #name, OLDEST, NEWEST);                                                         \
        return 0;                                                                                \
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
    if (status.type == 0) return 1;
    snprintf(process.why, WHY, "Python does not start: %s",
             status.message != NULL ? status.message : "no reason given");
    return 0;
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

static int start_python(char *why) {
    if (process.python == UNTRIED) {
        process.python = py.Py_IsInitialized() || start() ? RUNS : FAILED;
    }
    if (process.python == FAILED) snprintf(why, WHY, "%s", process.why);
    return process.python == RUNS;
}

static int load_pythonfmu(char *why) {
    void *library = companion[0] == '\0' ? NULL : dlopen(companion, RTLD_NOW | RTLD_LOCAL);
    if (library == NULL) {
        snprintf(why, WHY, "cannot load PythonFMU's library: %s",
                 companion[0] == '\0' ? "its path is too long" : dlerror());
    } else if (dlsym(library, "finalizePythonInterpreter") == NULL) {
        snprintf(why, WHY, "the library next to the loader is not PythonFMU's");
    } else {
        pythonfmu = library;
    }
    return pythonfmu != NULL;
}

/* Brings Python and PythonFMU into the process, if they are not. */
int loaded(char *why) {
    if (pythonfmu == NULL) {
        pthread_mutex_lock(&process.lock);
        (void)(pythonfmu != NULL ||
               (find_python(why) && start_python(why) && load_pythonfmu(why)));
        pthread_mutex_unlock(&process.lock);
    }
    if (pythonfmu != NULL && !py.Py_IsInitialized()) {
        snprintf(why, WHY, "the host has ended Python");
        return 0;
    }
    return pythonfmu != NULL;
}

int has_loaded(void) { return pythonfmu != NULL; }

int python_runs(void) { return has_loaded() && py.Py_IsInitialized(); }

void *pythonfmu_function(string name) { return dlsym(pythonfmu, name); }

/* Waits until no other thread makes an instance, of any FMU, which changes sys.path. The interpreter
 * lock is given away meanwhile: a thread that makes one needs it. */
void begin_making(void) {
    while (process.making > 0 && process.family == getpid() &&
           !pthread_equal(process.maker, pthread_self())) {
        wait_without_lock();
    }
    if (process.family != getpid()) process.making = 0;
    process.family = getpid();
    process.maker = pthread_self();
    process.making++;
}

void end_making(void) { process.making--; }

/* Lets other threads have the interpreter lock for a while. */
void wait_without_lock(void) {
    void *thread = py.PyEval_SaveThread();
    usleep(WAIT);
    py.PyEval_RestoreThread(thread);
}

uint64_t next_serial(void) { return ++process.serial; }

/* Whether a Python exception is set, in words; it is set no longer. */
int exception(char *why) {
    void *type = NULL, *value = NULL, *trace = NULL;
    if (py.PyErr_Occurred() == NULL) return 0;
    py.PyErr_Fetch(&type, &value, &trace);
    void *words = py.PyObject_Repr(value != NULL ? value : type);
    string text = words != NULL ? py.PyUnicode_AsUTF8(words) : NULL;
    snprintf(why, WHY, "%s", text != NULL ? text : "an exception without a message");
    py.PyErr_Clear();
    py.Py_DecRef(words);
    py.Py_DecRef(trace);
    py.Py_DecRef(value);
    py.Py_DecRef(type);
    return 1;
}
