/* What both runtimes share: that of components in C, and the loader of those in Python.
 *
 * text.c      texts of messages, and which bytes are text
 * host.c      the host's arguments and its logger
 * handles.c   tells what is alive from what is not
 * calls.c     what every call begins with, and the host's states
 *
 * Names use a few verbs in one sense, as fmus/python/callbacks.py does:
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
    int allowed; /* the modes that it may come in, of modes.h */
    int status;  /* what the call is answered with */
} call;

#endif
