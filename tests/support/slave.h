/* What slaves of FMI 2.0 have in common that are written for tests: FMI's types, and the functions
   that none of them does anything in. */

#include <stddef.h>

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

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

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

/* What a host may look for, and nobody here calls. */
#define ABSENT(name) \
    Status name(void) { return Error; }
#ifndef HAS_STRINGS
ABSENT(fmi2GetString)
ABSENT(fmi2SetString)
#endif
#ifndef HAS_STATE
ABSENT(fmi2GetFMUstate)
ABSENT(fmi2SetFMUstate)
ABSENT(fmi2FreeFMUstate)
ABSENT(fmi2SerializedFMUstateSize)
ABSENT(fmi2SerializeFMUstate)
#ifndef LACKS
ABSENT(fmi2DeSerializeFMUstate)
#endif
#endif
#ifndef HAS_DERIVATIVES
ABSENT(fmi2GetDirectionalDerivative)
ABSENT(fmi2SetRealInputDerivatives)
#endif
ABSENT(fmi2GetRealOutputDerivatives)
ABSENT(fmi2CancelStep)
#ifndef HAS_STATUS
ABSENT(fmi2GetStatus)
ABSENT(fmi2GetRealStatus)
ABSENT(fmi2GetBooleanStatus)
#endif
ABSENT(fmi2GetIntegerStatus)
ABSENT(fmi2GetStringStatus)
