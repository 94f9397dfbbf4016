/* Code that both kinds of component share: the runtime of the C kind, and the loader of the Python
 * kind.
 *
 * text.c      messages, UTF-8
 * host.c      the host's arguments and its logger
 * handles.c   handles of live instances and states
 * calls.c     the beginning of every call, instances, and the host's states
 * functions.h the functions of FMI 2.0
 *
 * Some verbs always have the same meaning, also in fmus/python/component.py:
 *
 * check    test something, and write or return the reason if it is invalid
 * refuse   answer a call with another status than OK, and log the reason
 * fail     refuse with an error, after which the instance is in FMI's error state
 * log      pass a message to the host's logger
 *
 * A function that can fail writes a reason into `why`, and returns 0.
 */
#ifndef HOST_H
#define HOST_H

#include <stddef.h>
#include <stdint.h>

typedef const char *string;

/* fmi2Status and fmi3Status. */
enum { FMI_OK, FMI_WARNING, FMI_DISCARD, FMI_ERROR, FMI_FATAL };

/* Modes of an instance, and the modes in which each function is allowed; in others it is an error.
 *
 * docs/reference/fmi-answers.md lists every call in every mode, and explains why more is allowed
 * here than in the standards. AFTER_ERROR, FMI's error state, occurs in each of the others. */
typedef enum {
    INSTANTIATED,
    INITIALISING,
    STEPPING,    /* co-simulation */
    IN_EVENT,    /* model exchange, in event mode */
    INTEGRATING, /* model exchange, in continuous-time mode */
    TERMINATED,
    AFTER_ERROR
} mode;

#define WHEN(mode) (1 << (mode))
#define EXCHANGING (WHEN(IN_EVENT) | WHEN(INTEGRATING))
#define BEFORE_THE_END (WHEN(INSTANTIATED) | WHEN(INITIALISING) | WHEN(STEPPING) | EXCHANGING)
#define NOT_AFTER_ERROR (BEFORE_THE_END | WHEN(TERMINATED))
#define ALWAYS (NOT_AFTER_ERROR | WHEN(AFTER_ERROR))

#define MASK_SetDebugLogging ALWAYS
#define MASK_SetupExperiment WHEN(INSTANTIATED)
#define MASK_EnterInitializationMode WHEN(INSTANTIATED)
#define MASK_ExitInitializationMode WHEN(INITIALISING)
#define MASK_DoStep WHEN(STEPPING)
#define MASK_EnterEventMode WHEN(INTEGRATING)
#define MASK_EnterContinuousTimeMode WHEN(IN_EVENT)
#define MASK_EvaluateDiscreteStates (WHEN(INITIALISING) | WHEN(IN_EVENT))
#define MASK_UpdateDiscreteStates WHEN(IN_EVENT)
#define MASK_CompletedIntegratorStep WHEN(INTEGRATING)
#define MASK_SetTime EXCHANGING
#define MASK_SetContinuousStates WHEN(INTEGRATING)
#define MASK_Terminate NOT_AFTER_ERROR
#define MASK_Reset ALWAYS
#define MASK_FreeInstance ALWAYS
#define MASK_Get ALWAYS /* values, and the status of a step */
#define MASK_Set BEFORE_THE_END
#define MASK_FMUstate ALWAYS     /* all functions about states */
#define MASK_NotSupported ALWAYS /* all other functions */

/* The host's logger, cast to a common type, and its argument. */
typedef struct {
    void (*function)(void);
    void *environment;
} logger;

/* The logger of an instance, and its settings. */
typedef struct {
    logger host;
    char *name;
    int logging;
    size_t n;
    char **categories; /* wanted categories; none: all */
} listener;

typedef struct instance instance;
typedef struct entry entry;

/* A call in progress. */
typedef struct {
    instance *instance; /* NULL: the handle is not a live instance */
    entry *entry;       /* entry of the instance, locked by the call */
    string function;
    int allowed; /* modes in which it is allowed */
    int status;  /* status that it returns */
    int rated;   /* true once the rates of the states are computed */
} call;

#endif
