/* The functions of FMI 2.0, and the one file to compile: it includes all others.
 */
#include "component.h"
#include "fmi2.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#if defined(FMI2_FUNCTION_PREFIX) && !defined(FMI2_OVERRIDE_FUNCTION_PREFIX)
#define FMI2(name) PREFIXED(FMI2_FUNCTION_PREFIX, name)
#else
#define FMI2(name) name
#endif

static const names version = {
    .types = {"Real", "Integer", "Boolean", "Enumeration"},
    .enumerations_are_integers = 1,
    .token = "GUID",
};

/* Value references are places among the variables. */
enum { FIRST_REFERENCE = 0 };

#include "component.c"

/* FMI 2.0 defines a message as a format: a host would take a % for a directive. */
static void call_logger(const logger *host, string name, int status, string category, string text) {
    char format[2 * MOST_TEXT + 1];
    copy_doubled(format, text, '%');
    ((fmi2_logger)host->function)(host->environment, name, status, category, format);
}

/* A function that does something unless anything is wrong with its arguments. */
#define FUNCTION(name, allowed, wrong, parameters, action)                                       \
    EXPORT int FMI2(name) parameters {                                                           \
        call this = begin(c, #name, allowed);                                                    \
        if (GOES_ON(this, wrong)) {                                                              \
            action;                                                                              \
        }                                                                                        \
        return end(&this);                                                                       \
    }

EXPORT string FMI2(fmi2GetTypesPlatform)(void) { return "default"; }

EXPORT string FMI2(fmi2GetVersion)(void) { return "2.0"; }

/* Making and freeing. The component needs no resources. */

EXPORT void *FMI2(fmi2Instantiate)(string name, int type, string guid, string location,
                                   const callbacks *functions, int visible, int logging) {
    return instantiate("fmi2Instantiate",
                       type == CO_SIMULATION ? NULL : "this FMU is for co-simulation only", name,
                       guid, logger_of(functions), logging);
}

EXPORT void FMI2(fmi2FreeInstance)(void *c) { free_instance(c, "fmi2FreeInstance"); }

FUNCTION(fmi2Reset, MASK_Reset, NULL, (void *c), reset(&this))
FUNCTION(fmi2SetDebugLogging, MASK_SetDebugLogging, wrong_texts(n, categories),
       (void *c, int on, size_t n, const string categories[]),
       choose_messages(&this, on, n, categories))

/* Modes and steps */

FUNCTION(fmi2SetupExperiment, MASK_SetupExperiment, NULL,
       (void *c, int has_tolerance, double tolerance, double start, int has_stop, double stop),
       set_experiment(&this, start, has_stop ? stop : INFINITY))
FUNCTION(fmi2EnterInitializationMode, MASK_EnterInitializationMode, NULL, (void *c),
       enter_initialisation(&this))
FUNCTION(fmi2ExitInitializationMode, MASK_ExitInitializationMode, NULL, (void *c),
       exit_initialisation(&this))
FUNCTION(fmi2Terminate, MASK_Terminate, NULL, (void *c), terminate(&this))
FUNCTION(fmi2DoStep, MASK_DoStep, NULL, (void *c, double time, double step, int no_set),
       take_step(&this, time, step))

/* Values */

#define FOR_EACH(action)                                                                         \
    for (size_t i = 0; i < n; i++) action

#define GET(name, type, action)                                                                  \
    FUNCTION(name, MASK_Get, wrong_values(n, r, v),                                              \
           (void *c, const uint32_t r[], size_t n, type v[]), action)
#define GET_EACH(name, type, get)                                                                \
    GET(name, type, {                                                                            \
        prepare_to_get(&this, r, n);                                                             \
        FOR_EACH(v[i] = get(&this, r[i]));                                                       \
    })
#define SET(name, type, wrong, action)                                                           \
    FUNCTION(name, MASK_Set, wrong,                                                              \
           (void *c, const uint32_t r[], size_t n, const type v[]), action)
#define SET_EACH(name, c_type, type, number)                                                     \
    SET(name, c_type, wrong_values(n, r, v), {                                                   \
        setting it = begin_setting(&this, type, r, n);                                           \
        FOR_EACH(set_value(&it, r[i], number));                                                  \
        end_setting(&it);                                                                        \
    })

GET(fmi2GetReal, double, get_reals(&this, r, n, v))
GET_EACH(fmi2GetInteger, int, get_integer)
GET_EACH(fmi2GetBoolean, int, get_boolean)
SET(fmi2SetReal, double, wrong_values(n, r, v), set_reals(&this, r, n, v))
SET_EACH(fmi2SetInteger, int, INTEGER, v[i])
SET_EACH(fmi2SetBoolean, int, BOOLEAN, v[i] != 0)

/* No variable is a text. */
GET(fmi2GetString, string, {
    FOR_EACH(v[i] = "");
    get_unknown(&this, "String", r, n);
})
SET(fmi2SetString, string, wrong_strings(n, r, v), set_unknown(&this, "String", r, n))

/* States */

FUNCTION(fmi2GetFMUstate, MASK_FMUstate, NULL, (void *c, void **state), get_state(&this, state))
FUNCTION(fmi2SetFMUstate, MASK_FMUstate, NULL, (void *c, void *state), set_state(&this, state))
FUNCTION(fmi2FreeFMUstate, MASK_FMUstate, NULL, (void *c, void **state), free_state(&this, state))
FUNCTION(fmi2SerializedFMUstateSize, MASK_FMUstate, NULL, (void *c, void *state, size_t *size),
       size_of_state(&this, state, size))
FUNCTION(fmi2SerializeFMUstate, MASK_FMUstate, NULL,
       (void *c, void *state, char bytes[], size_t size),
       serialise_state(&this, state, (unsigned char *)bytes, size))
FUNCTION(fmi2DeSerializeFMUstate, MASK_FMUstate, NULL,
       (void *c, const char bytes[], size_t size, void **state),
       deserialise_state(&this, (const unsigned char *)bytes, size, state))

/* What is not supported, or hardly */

#define NOT_SUPPORTED(name, wrong, status, parameters)                                           \
    FUNCTION(name, MASK_NotSupported, wrong, parameters, refuse_unsupported(&this, status))

NOT_SUPPORTED(fmi2GetDirectionalDerivative, NULL, FMI_ERROR,
              (void *c, const uint32_t u[], size_t nu, const uint32_t k[], size_t nk,
               const double dk[], double du[]))
NOT_SUPPORTED(fmi2SetRealInputDerivatives, NULL, FMI_ERROR,
              (void *c, const uint32_t r[], size_t n, const int order[], const double v[]))
NOT_SUPPORTED(fmi2GetRealOutputDerivatives, NULL, FMI_ERROR,
              (void *c, const uint32_t r[], size_t n, const int order[], double v[]))
NOT_SUPPORTED(fmi2CancelStep, NULL, FMI_ERROR, (void *c))

NOT_SUPPORTED(fmi2GetStatus, wrong_place(v), FMI_ERROR, (void *c, int kind, int *v))
NOT_SUPPORTED(fmi2GetIntegerStatus, wrong_place(v), FMI_DISCARD,
              (void *c, int kind, int *v))
NOT_SUPPORTED(fmi2GetStringStatus, wrong_place(v), FMI_DISCARD,
              (void *c, int kind, string *v))

#define OF_MODEL_EXCHANGE(name, parameters)                                                      \
    NOT_SUPPORTED(name, NULL, FMI_ERROR, parameters)

MODEL_EXCHANGE_FUNCTIONS(OF_MODEL_EXCHANGE)

FUNCTION(fmi2GetRealStatus, MASK_Get, wrong_place(v), (void *c, int kind, double *v), {
    if (kind == LAST_SUCCESSFUL_TIME) {
        *v = time_of(&this);
    } else {
        this.status = FMI_DISCARD;
        log_message(this.instance, FMI_DISCARD, "Invalid status inquiry for fmi2GetRealStatus");
    }
})

/* No answer: with "true" hosts would end the run as a success, and with "false" FMPy would repeat a
 * refused step without end. */
FUNCTION(fmi2GetBooleanStatus, MASK_Get, wrong_place(v), (void *c, int kind, int *v), {
    *v = 0;
    this.status = FMI_DISCARD;
})
