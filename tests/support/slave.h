/* FMI's types, for slaves of FMI 2.0 that tests write. defaults.c has the functions
   that a slave leaves out. */

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

/* State functions for a state that is one block of memory of the given type. The FMU has
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
