/* The functions of FMI 2.0, and the one file to compile: it includes all others.
 *
 * Where FMI2_FUNCTION_PREFIX is defined, as the standard has it, it stands before the names of the
 * functions, so that several FMUs can be linked into one program.
 */
#include "component.h"

#include <stdlib.h>
#include <string.h>

#if defined(FMI2_FUNCTION_PREFIX) && !defined(FMI2_OVERRIDE_FUNCTION_PREFIX)
#define PASTE(prefix, name) prefix##name
#define PREFIXED(prefix, name) PASTE(prefix, name)
#define FMI2(name) PREFIXED(FMI2_FUNCTION_PREFIX, name)
#else
#define FMI2(name) name
#endif

enum { CO_SIMULATION = 1 };

/* A kind of fmi2GetRealStatus. */
enum { LAST_SUCCESSFUL_TIME = 2 };

typedef void (*fmi2_logger)(void *, string, int, string, string, ...);

/* fmi2CallbackFunctions, of which only the logger is used. */
typedef struct {
    fmi2_logger logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} callbacks;

static const names version = {
    .types = {"Real", "Integer", "Boolean", "String"},
    .token = "GUID",
};

/* Value references are places among the variables. */
enum { FIRST_REFERENCE = 0 };

#include "component.c"
#include "model_exchange.h"

/* Functions of FMI take more than a component has to know. */
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

/* FMI 2.0 defines a message as a format: a host would take a % for a directive. */
static void deliver(const logger *host, string instance_name, int status, string category,
                    string text) {
    char format[2 * MOST_TEXT + 1], *end = format;
    for (; *text != '\0'; text++) {
        if (*text == '%') *end++ = '%';
        *end++ = *text;
    }
    *end = '\0';
    ((fmi2_logger)host->function)(host->environment, instance_name, status, category, format);
}

/* A function that does something unless anything is wrong with its arguments. */
#define ANSWER(name, when, wrong, parameters, action)                                            \
    EXPORT int FMI2(name) parameters {                                                           \
        call this = begin(c, #name, when);                                                       \
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
    logger host = {NULL, NULL};
    if (functions != NULL) {
        host = (logger){(void (*)(void))functions->logger, functions->environment};
    }
    return instantiate("fmi2Instantiate",
                       type == CO_SIMULATION ? NULL : "this FMU is for co-simulation only", name,
                       guid, host, logging);
}

EXPORT void FMI2(fmi2FreeInstance)(void *c) { free_instance(c, "fmi2FreeInstance"); }

ANSWER(fmi2Reset, ALWAYS, NULL, (void *c), reset(&this))
ANSWER(fmi2SetDebugLogging, ALWAYS, NULL,
       (void *c, int on, size_t n, const string categories[]),
       choose_messages(&this, on, n, categories))

/* Modes and steps */

ANSWER(fmi2SetupExperiment, NOT_AFTER_ERROR, NULL,
       (void *c, int has_tolerance, double tolerance, double start, int has_stop, double stop),
       set_experiment(&this, start))
ANSWER(fmi2EnterInitializationMode, NOT_AFTER_ERROR, NULL, (void *c), enter_initialisation(&this))
ANSWER(fmi2ExitInitializationMode, NOT_AFTER_ERROR, NULL, (void *c), exit_initialisation(&this))
ANSWER(fmi2Terminate, NOT_AFTER_ERROR, NULL, (void *c), terminate(&this))
ANSWER(fmi2DoStep, NOT_AFTER_ERROR, NULL, (void *c, double time, double step, int no_set),
       take_step(&this, time, step))

/* Values */

#define FOR_EACH(action)                                                                         \
    for (size_t i = 0; i < n; i++) action

#define GET(name, type, action)                                                                  \
    ANSWER(name, ALWAYS, wrong_values(n, r, v),                                                  \
           (void *c, const uint32_t r[], size_t n, type v[]), action)
#define GET_EACH(name, type, get)                                                                \
    GET(name, type, {                                                                            \
        prepare_to_get(&this, r, n);                                                             \
        FOR_EACH(v[i] = get(&this, r[i]));                                                       \
    })
#define SET(name, type, wrong, action)                                                           \
    ANSWER(name, NOT_AFTER_ERROR, wrong,                                                         \
           (void *c, const uint32_t r[], size_t n, const type v[]), action)
#define SET_EACH(name, c_type, type, wrong, number, text)                                        \
    SET(name, c_type, wrong, {                                                                   \
        setting it = begin_setting(&this, type, r, n);                                           \
        FOR_EACH(set_value(&it, r[i], number, text));                                            \
        end_setting(&it);                                                                        \
    })

GET(fmi2GetReal, double, get_reals(&this, r, n, v))
GET_EACH(fmi2GetInteger, int, get_integer)
GET_EACH(fmi2GetBoolean, int, get_boolean)
GET(fmi2GetString, string, FOR_EACH(v[i] = get_string(&this, r[i])))
SET(fmi2SetReal, double, wrong_values(n, r, v), set_reals(&this, r, n, v))
SET_EACH(fmi2SetInteger, int, INTEGER, wrong_values(n, r, v), v[i], NULL)
SET_EACH(fmi2SetBoolean, int, BOOLEAN, wrong_values(n, r, v), v[i] != 0, NULL)
SET_EACH(fmi2SetString, string, STRING, wrong_strings(n, r, v), 0.0, v[i])

/* States */

ANSWER(fmi2GetFMUstate, ALWAYS, NULL, (void *c, void **state), get_state(&this, state))
ANSWER(fmi2SetFMUstate, ALWAYS, NULL, (void *c, void *state), set_state(&this, state))
ANSWER(fmi2FreeFMUstate, ALWAYS, NULL, (void *c, void **state), free_state(&this, state))
ANSWER(fmi2SerializedFMUstateSize, ALWAYS, NULL, (void *c, void *state, size_t *size),
       size_of_state(&this, state, size))
ANSWER(fmi2SerializeFMUstate, ALWAYS, NULL, (void *c, void *state, char bytes[], size_t size),
       serialise_state(&this, state, (unsigned char *)bytes, size))
ANSWER(fmi2DeSerializeFMUstate, ALWAYS, NULL,
       (void *c, const char bytes[], size_t size, void **state),
       deserialise_state(&this, (const unsigned char *)bytes, size, state))

/* What is not supported, or hardly */

static int not_supported(call *this, int status) {
    message said;
    compose(&said, "FMI function not supported: %s", this->function);
    tell(this->instance, status, said.text);
    return status;
}

#define NOT_SUPPORTED(name, when, wrong, answer, parameters)                                     \
    ANSWER(name, when, wrong, parameters, this.status = not_supported(&this, answer))

NOT_SUPPORTED(fmi2GetDirectionalDerivative, ALWAYS, NULL, FMI_ERROR,
              (void *c, const uint32_t u[], size_t nu, const uint32_t k[], size_t nk,
               const double dk[], double du[]))
NOT_SUPPORTED(fmi2SetRealInputDerivatives, NOT_AFTER_ERROR, NULL, FMI_ERROR,
              (void *c, const uint32_t r[], size_t n, const int order[], const double v[]))
NOT_SUPPORTED(fmi2GetRealOutputDerivatives, ALWAYS, NULL, FMI_ERROR,
              (void *c, const uint32_t r[], size_t n, const int order[], double v[]))
NOT_SUPPORTED(fmi2CancelStep, NOT_AFTER_ERROR, NULL, FMI_ERROR, (void *c))

static string wrong_place_of(const void *value) { return value == NULL ? "NULL" : NULL; }

NOT_SUPPORTED(fmi2GetStatus, ALWAYS, wrong_place_of(v), FMI_ERROR, (void *c, int kind, int *v))
NOT_SUPPORTED(fmi2GetIntegerStatus, ALWAYS, wrong_place_of(v), FMI_DISCARD,
              (void *c, int kind, int *v))
NOT_SUPPORTED(fmi2GetStringStatus, ALWAYS, wrong_place_of(v), FMI_DISCARD,
              (void *c, int kind, string *v))

#define OF_MODEL_EXCHANGE(name, parameters)                                                      \
    NOT_SUPPORTED(name, NOT_AFTER_ERROR, NULL, FMI_ERROR, parameters)

MODEL_EXCHANGE_FUNCTIONS(OF_MODEL_EXCHANGE)

ANSWER(fmi2GetRealStatus, ALWAYS, wrong_place_of(v), (void *c, int kind, double *v), {
    if (kind == LAST_SUCCESSFUL_TIME) {
        *v = time_of(&this);
    } else {
        this.status = FMI_DISCARD;
        tell(this.instance, FMI_DISCARD, "Invalid status inquiry for fmi2GetRealStatus");
    }
})

/* No answer: with "true" hosts would end the run as a success, and with "false" FMPy would repeat a
 * refused step without end. */
ANSWER(fmi2GetBooleanStatus, ALWAYS, wrong_place_of(v), (void *c, int kind, int *v), {
    *v = 0;
    this.status = FMI_DISCARD;
})
