/* Shared declarations of the loader. fmi2.c is compiled, and includes all other files.
 *
 * python.c  finds and starts Python, once a process; runs preflight.py, which checks that PythonFMU
 *           can make an instance
 * guard.c   the host's instance, its messages, and the beginning and end of every call
 * fmi2.c    the functions of FMI 2.0
 */
#ifndef LOADER_H
#define LOADER_H

#include "../../native/runtime/platform.h"

#include "../../native/runtime/fmi2.h"
#include "../../native/runtime/text.c"

/* Python */

/* The functions of Python that are used, under their own names. */
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

/* A message that is passed to the host at the end of the call. */
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
    callbacks heard; /* callbacks for PythonFMU */
    void *slave;     /* PythonFMU's own instance */
    int lock;        /* result of PyGILState_Ensure in this call */
    int answer;      /* status that the slave logged for the call */
    double time_told; /* time that the slave logged in the call, NaN: none */
    double last_successful_time;
    int in_error;
    int is_lost; /* set after fmi2Fatal: PythonFMU may have freed parts of it */
};

#endif
