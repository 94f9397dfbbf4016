/* What both kinds of component share: the runtime of those in C, and the loader of those in Python.
 *
 * text.c      texts of messages, and which bytes are text
 * host.c      the host's arguments and its logger
 * handles.c   tells what is alive from what is not
 * calls.c     what every call begins with, instances, and the host's states
 * functions.h the functions of FMI 2.0
 *
 * Names use a few verbs in one sense, as fmus/python/component.py does:
 *
 * check    whether something is good; writes or gives the reason if it is not
 * refuse   answer a call with another status than OK, and log the reason
 * fail     refuse with an error, after which the instance is in FMI's error state
 * log      hand a message to the host's logger
 *
 * A function that can fail writes a reason into `why`, and gives 0.
 */
#ifndef HOST_H
#define HOST_H

#include <stddef.h>
#include <stdint.h>

typedef const char *string;

/* fmi2Status and fmi3Status. */
enum { FMI_OK, FMI_WARNING, FMI_DISCARD, FMI_ERROR, FMI_FATAL };

/* Modes of an instance, and those in which a function may be called; in any other it is an error.
 *
 * docs/reference/fmi-answers.md has every call in every mode, and says why more is allowed here
 * than in the standards. The last one, FMI's state error, may be had in each of the others. */
typedef enum { INSTANTIATED, INITIALISING, STEPPING, TERMINATED, AFTER_ERROR } mode;

#define WHEN(mode) (1 << (mode))
#define BEFORE_THE_END (WHEN(INSTANTIATED) | WHEN(INITIALISING) | WHEN(STEPPING))
#define NOT_AFTER_ERROR (BEFORE_THE_END | WHEN(TERMINATED))
#define ALWAYS (NOT_AFTER_ERROR | WHEN(AFTER_ERROR))

#define MASK_SetDebugLogging ALWAYS
#define MASK_SetupExperiment WHEN(INSTANTIATED)
#define MASK_EnterInitializationMode WHEN(INSTANTIATED)
#define MASK_ExitInitializationMode WHEN(INITIALISING)
#define MASK_DoStep WHEN(STEPPING)
#define MASK_Terminate NOT_AFTER_ERROR
#define MASK_Reset ALWAYS
#define MASK_FreeInstance ALWAYS
#define MASK_Get ALWAYS /* values, and what is known of a step */
#define MASK_Set BEFORE_THE_END
#define MASK_FMUstate ALWAYS     /* all functions about states */
#define MASK_NotSupported ALWAYS /* all others */

/* The host's logger, as the version of FMI casts it, and what it is called with. */
typedef struct {
    void (*function)(void);
    void *environment;
} logger;

/* What an instance logs. */
typedef struct {
    logger host;
    char *name;
    int logging;
    size_t n;
    char **categories; /* that are wanted; none: all */
} listener;

typedef struct instance instance;
typedef struct entry entry;

/* A call between its beginning and its end. */
typedef struct {
    instance *instance; /* NULL: the handle belongs to no live instance */
    entry *entry;       /* of the instance, which the call has locked */
    string function;
    int allowed; /* the modes that it may come in */
    int status;  /* what the call is answered with */
} call;

#endif
