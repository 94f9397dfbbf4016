/* What the parts of the loader know of each other. fmi2.c is compiled, and includes all others.
 *
 * python.c  finds Python and starts it, once a process; has preflight.py find out whether PythonFMU
 *           can make an instance
 * guard.c   the instance that the host holds, its messages, and the ends of every call
 * fmi2.c    the functions of FMI 2.0
 */
#ifndef LOADER_H
#define LOADER_H

#include "../../native/runtime/platform.h"

#include "../../native/runtime/fmi2.h"
#include "../../native/runtime/text.c"

/* Python */

/* Of its functions those that are used here, under their own names. */
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
    F(void, Py_DecRef, (void *))

typedef struct {
    int type;
    string function, message;
    int exit_code;
} python_status;

#define DECLARE(type, name, parameters) type(*name) parameters;
static struct {
    PYTHON_FUNCTIONS(DECLARE)
} py;
#undef DECLARE

/* The instance */

/* A message that the host gets at the end of the call. */
typedef struct queued queued;
struct queued {
    queued *next;
    int status;
    char *text; /* after the category */
    char category[1];
};

struct instance {
    listener host;
    queued *queue;
    int has_logged_error;
    callbacks heard; /* what PythonFMU gets for callbacks */
    void *slave;     /* PythonFMU's own instance */
    int lock;        /* what the call got with the global interpreter lock */
    int answer;      /* the status that the slave has for the call */
    double time_told; /* by the slave in the call, NaN: none */
    double last_successful_time;
    int in_error;
    int is_lost; /* after fmi2Fatal: PythonFMU may have freed parts of it */
};

#endif
