/* What slaves of FMI 2.0 have in common that are written for tests: FMI's types. What a slave leaves
   out is in defaults.c. */

#include <stddef.h>
#include <stdlib.h>
#include <string.h>

typedef void *Component;
typedef enum { OK, Warning, Discard, Error, Fatal } Status;
typedef void (*Logger)(void *, const char *, Status, const char *, const char *, ...);
typedef struct {
    Logger logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *step_finished;
    void *environment;
} Callbacks;

/* What is the same for all states that are one block of memory: its type is given. The FMU has
   fmi2GetFMUstate and fmi2SetFMUstate of its own. */
#define STATE_IS(type) \
    Status fmi2FreeFMUstate(Component c, void **state) \
    { \
        free(*state); \
        *state = NULL; \
        return OK; \
    } \
    Status fmi2SerializedFMUstateSize(Component c, void *state, size_t *size) \
    { \
        *size = sizeof(type); \
        return OK; \
    } \
    Status fmi2SerializeFMUstate(Component c, void *state, char *bytes, size_t size) \
    { \
        memcpy(bytes, state, size); \
        return OK; \
    } \
    Status fmi2DeSerializeFMUstate(Component c, const char *bytes, size_t size, void **state) \
    { \
        *state = memcpy(malloc(size), bytes, size); \
        return OK; \
    }
