/* What a host passes in, and what it is told: the same for components in C and for the loader of
 * those in Python.
 *
 * utf8.c       which bytes are text
 * arguments.c  what can be wrong with arrays
 * listener.c   what the host wants to hear, and how it is told
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

typedef struct {
    logger host;
    char *name;
    int logging;
    size_t n;
    char **categories; /* that are wanted; none: all */
} listener;

/* How far the stack reaches down where it is called. */
#if defined(_MSC_VER)
#define DEPTH() ((uintptr_t)_AddressOfReturnAddress())
#define APART __declspec(noinline)
#else
#define DEPTH() ((uintptr_t)__builtin_frame_address(0))
#define APART __attribute__((noinline))
#endif

/* More stack than lies between two calls of a host that goes on after its logger was left. */
#define MARGIN(name)                                                                             \
    volatile char name[1 << 14];                                                                 \
    name[0] = 0;                                                                                 \
    (void)name[0]

/* Of the version: calls the logger, which is not NULL. */
static void deliver(const logger *host, string instance_name, int status, string category,
                    string text);

#endif
