/* What the parts of the loader know of each other. fmi2.c is compiled, and includes all others.
 *
 * python.c     finds Python and starts it, once a process
 * preflight.c  has preflight.py find out whether PythonFMU can make an instance
 * handles.c    tells what is alive from what is not
 * messages.c   what the host is told
 * location.c   the resource location
 * guard.c      the instance that the host holds, and what every call begins and ends with
 * fmi2.c       the functions of FMI 2.0
 *
 * A function that can fail writes a reason into `why`, of WHY characters, and gives 0.
 */
#ifndef LOADER_H
#define LOADER_H

#include <pthread.h>

#include "../../native/runtime/host.h"
#include "../../native/runtime/modes.h"

#define EXPORT __attribute__((visibility("default")))

enum { WHY = 1024 };

/* FMI */

enum { CO_SIMULATION = 1 };

typedef void *component;
typedef unsigned int reference;

/* fmi2CallbackFunctions, of which only the logger is used. */
typedef struct {
    void (*logger)(void *, string, int, string, string, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} callbacks;

/* location.c */

int plain_path(string uri, char **path, char *why);

/* python.c */

/* Of Python's functions those that are used here, under their own names. */
#define PYTHON_FUNCTIONS(F)                                                                      \
    F(int, Py_IsInitialized, (void))                                                             \
    F(void, PyPreConfig_InitIsolatedConfig, (void *))                                            \
    F(python_status, Py_PreInitialize, (const void *))                                           \
    F(void, PyConfig_InitIsolatedConfig, (void *))                                               \
    F(python_status, Py_InitializeFromConfig, (const void *))                                    \
    F(void, PyConfig_Clear, (void *))                                                            \
    F(void *, PyEval_SaveThread, (void))                                                         \
    F(void, PyEval_RestoreThread, (void *))                                                      \
    F(int, PyGILState_Ensure, (void))                                                            \
    F(void, PyGILState_Release, (int))                                                           \
    F(int, PyRun_SimpleStringFlags, (string, void *))                                            \
    F(void *, PyRun_StringFlags, (string, int, void *, void *, void *))                          \
    F(void *, PyDict_New, (void))                                                                \
    F(void *, PyDict_GetItemString, (void *, string))                                            \
    F(void *, PyObject_CallFunction, (void *, string, ...))                                      \
    F(void *, PyObject_Repr, (void *))                                                           \
    F(string, PyUnicode_AsUTF8, (void *))                                                        \
    F(void *, PyErr_Occurred, (void))                                                            \
    F(void, PyErr_Fetch, (void **, void **, void **))                                            \
    F(void, PyErr_Clear, (void))                                                                 \
    F(void, Py_IncRef, (void *))                                                                 \
    F(void, Py_DecRef, (void *))

typedef struct {
    int type;
    string function, message;
    int exit_code;
} python_status;

#define DECLARE(type, name, parameters) type(*name) parameters;
typedef struct {
    PYTHON_FUNCTIONS(DECLARE)
} python_functions;
#undef DECLARE

extern python_functions py;

int loaded(char *why);
int has_loaded(void);
int python_runs(void);
void *pythonfmu_function(string name);
uint64_t next_serial(void);
void wait_without_lock(void);
void begin_making(void);
void end_making(void);
int exception(char *why);

/* The global interpreter lock is the only lock of what follows. */

/* preflight.c */

int preflight(string resources, string guid, char *why);
void forget(string resources);

/* handles.c */

typedef enum { FREE, INSTANCE, STATE } kind;

void *new_handle(kind kind, void *thing, void *owner);
void *thing_of(void *handle, kind kind);
void replace(void *handle, void *thing, void *owner);
void drop(void *handle);
void *state_of(void *owner);

/* messages.c */

/* A message that the host has not been told yet. */
typedef struct untold untold;
struct untold {
    untold *next;
    int status;
    char *category, *text; /* after the name of the instance */
    char name[1];
};

/* guard.c */

typedef struct {
    listener host;
    untold *untold; /* in their order */
    int told;        /* whether the host has got a message of an error */
    callbacks heard; /* what PythonFMU gets for callbacks */
    component slave; /* PythonFMU's own instance */
    int answer;      /* the status that the slave has for the call */
    double last_successful_time;
    double time_told; /* by the slave in the call, NaN: none */
    enum { SOUND, IN_ERROR, LOST } condition;
    int busy;
    pthread_t thread; /* that is in a call */
    int telling;
    pthread_t teller; /* that calls the host's logger last, if it is telling */
    uintptr_t depth;  /* of its stack then */
} instance;

/* A call between its beginning and its end. */
typedef struct {
    instance *instance; /* NULL: there is none, and no lock to give back */
    component handle;
    string function;
    int status;
    int lock;
} call;

/* Whether a call may be forwarded: only then are its arguments checked. */
#define GOES_ON(call, wrong)                                                                    \
    ((call).instance != NULL && (call).status == FMI_OK && sound(&(call), wrong))

instance *new_instance(string name, const callbacks *functions, int logging);
void release_instance(instance *it);
call begin(component handle, string function, int allowed);
int sound(call *this, string wrong);
int refuse(call *this, string wrong);
void take_answer(call *this, int ends_in_error);
void give_back_and_tell(call *this);
int end(call *this);

void tell(instance *it, int status, string category, string text);
void tell_all(logger host, untold *messages);
void complain(instance *it, int status, string format, ...)
    __attribute__((format(printf, 3, 4)));

#endif
