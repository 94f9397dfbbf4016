/* The functions of FMI 3.0, and the file to compile: it includes all others.
 *
 * Functions that neither co-simulation nor model exchange needs without clocks return fmi3Error.
 */
#include "platform.h"

#include "host.h"

#if defined(FMI3_FUNCTION_PREFIX) && !defined(FMI3_OVERRIDE_FUNCTION_PREFIX)
#define NAMED(name) PREFIXED(FMI3_FUNCTION_PREFIX, name)
#else
#define NAMED(name) name
#endif

/* Value references are indices of the variables, from 1, since some hosts use them as such. */
enum { FIRST_REFERENCE = 1, HAS_TIME = 1 };

#include "component.c"

static const names version = {
    .types = {"Float64", "Int32", "Boolean", "Enumeration"},
    .token = "instantiation token",
};

/* fmi3Boolean and fmi3Clock. A host may pass any byte, although a bool is 0 or 1. */
typedef uint8_t boolean;

/* The variable for the time comes after all others. */
enum { TIME = FIRST_REFERENCE + N_PORTS };

/* Messages */

typedef void (*fmi3_logger)(void *environment, int status, string category, string text);

/* In FMI 3.0 a # marks the reference of a variable, so each # is doubled. */
static void call_logger(const logger *host, string name, int status, string category, string text) {
    char doubled[2 * MOST_TEXT + 1];
    copy_doubled(doubled, text, '#');
    ((fmi3_logger)host->function)(host->environment, status, category, doubled);
}

/* Turns the named categories, or all without names, on or off; the others are unchanged. */
static void switch_categories(call *this, int on, size_t n, const string names[]) {
    enum { ALL = sizeof CATEGORIES / sizeof *CATEGORIES };
    string chosen[ALL];
    size_t n_chosen = 0;
    for (size_t i = 0; i < ALL; i++) {
        int named = n == 0;
        for (size_t k = 0; k < n && !named; k++) named = strcmp(names[k], CATEGORIES[i]) == 0;
        if (named ? on : is_wanted(&this->instance->host, FMI_OK, CATEGORIES[i])) {
            chosen[n_chosen++] = CATEGORIES[i];
        }
    }
    choose_messages(this, n_chosen > 0, n_chosen, chosen);
}

FUNCTION(fmi3SetDebugLogging, MASK_SetDebugLogging, wrong_texts(n, names),
         (void *c, boolean on, size_t n, const string names[]),
         switch_categories(&this, on, n, names))

/* Making and freeing */

EXPORT string NAMED(fmi3GetVersion)(void) { return "3.0"; }

static void *make(string function, string wrong, string name, string token, boolean logging,
                  void *environment, fmi3_logger log) {
    logger host = {(void (*)(void))log, environment};
    return instantiate(function, wrong, name, version.token, token, NULL, 0, host, logging != 0);
}

EXPORT void *NAMED(fmi3InstantiateCoSimulation)(
    string name, string token, string resources, boolean visible, boolean logging,
    boolean event_mode_used, boolean early_return_allowed, const uint32_t intermediate[],
    size_t n_intermediate, void *environment, fmi3_logger log, void (*update)(void)) {
    return make("fmi3InstantiateCoSimulation",
                event_mode_used ? "this FMU has no event mode" : NULL, name, token, logging,
                environment, log);
}

static const char ANOTHER_TYPE[] = "this FMU is for co-simulation only";

EXPORT void *NAMED(fmi3InstantiateModelExchange)(string name, string token, string resources,
                                                 boolean visible, boolean logging,
                                                 void *environment, fmi3_logger log) {
    return for_exchange(make("fmi3InstantiateModelExchange", EXCHANGES ? NULL : ANOTHER_TYPE, name,
                             token, logging, environment, log));
}

EXPORT void *NAMED(fmi3InstantiateScheduledExecution)(
    string name, string token, string resources, boolean visible, boolean logging,
    void *environment, fmi3_logger log, void (*update)(void *), void (*lock)(void),
    void (*unlock)(void)) {
    return make("fmi3InstantiateScheduledExecution", "this FMU has no scheduled execution", name,
                token, logging, environment, log);
}

EXPORT void NAMED(fmi3FreeInstance)(void *c) { free_instance(c, "fmi3FreeInstance"); }

/* Modes and steps */

FUNCTION(fmi3EnterInitializationMode, MASK_EnterInitializationMode, NULL,
         (void *c, boolean has_tolerance, double tolerance, double start, boolean has_stop,
          double stop),
         set_experiment(&this, start, has_stop ? stop : INFINITY);
         if (this.status == FMI_OK) enter_initialisation(&this))
FUNCTION(fmi3ExitInitializationMode, MASK_ExitInitializationMode, NULL, (void *c),
         exit_initialisation(&this))
FUNCTION(fmi3Terminate, MASK_Terminate, NULL, (void *c), terminate(&this))
FUNCTION(fmi3Reset, MASK_Reset, NULL, (void *c), renew(this.instance))
FUNCTION(fmi3DoStep, MASK_DoStep,
         event_handling_needed && terminate_simulation && early_return && last_successful_time
             ? NULL
             : "NULL",
         (void *c, double time, double step, boolean no_set, boolean *event_handling_needed,
          boolean *terminate_simulation, boolean *early_return, double *last_successful_time),
         take_step(&this, time, step);
         *event_handling_needed = *terminate_simulation = *early_return = 0;
         *last_successful_time = time_of(&this))

/* Values */

static string wrong_numbers(size_t n, const uint32_t r[], const void *values, size_t n_values) {
    size_t wanted = 0;
    for (size_t i = 0; i < n; i++) wanted += r == NULL ? 1 : span(r[i]);
    return wanted == n_values ? wrong_values(n, r, values)
                              : "the numbers of values and of references differ";
}

#define GET(name, type, ...)                                                                     \
    FUNCTION(name, MASK_Get, wrong_numbers(n, r, v, n_v),                                        \
             (void *c, const uint32_t r[], size_t n, type v[], size_t n_v), __VA_ARGS__)
#define SET(name, type, ...)                                                                     \
    FUNCTION(name, MASK_Set, wrong_numbers(n, r, v, n_v),                                        \
             (void *c, const uint32_t r[], size_t n, const type v[], size_t n_v), __VA_ARGS__)

static double get_float(call *this, uint32_t reference) {
    return reference == TIME ? time_of(this) : get_real(this, reference);
}

static int64_t get_enumeration(call *this, uint32_t reference) {
    return (int64_t)number_of(this, reference, ENUMERATION);
}

GET(fmi3GetFloat64, double, {
    prepare_to_get(&this, r, n);
    if (n != n_v || !get_all_reals(&this, r, n, v)) GET_EACH(get_float);
})
GET(fmi3GetInt32, int32_t, prepare_to_get(&this, r, n); GET_EACH(get_integer))
GET(fmi3GetBoolean, boolean, prepare_to_get(&this, r, n); GET_EACH(get_boolean))
GET(fmi3GetInt64, int64_t, prepare_to_get(&this, r, n); GET_EACH(get_enumeration))
SET(fmi3SetFloat64, double, if (n != n_v || !set_all_reals(&this, r, n, v)) {
    SET_EACH(REAL, v[k]);
})
SET(fmi3SetInt32, int32_t, SET_EACH(INTEGER, v[k]))
SET(fmi3SetBoolean, boolean, SET_EACH(BOOLEAN, v[k] != 0))
SET(fmi3SetInt64, int64_t, SET_EACH(ENUMERATION, v[k]))

/* Types that no variable has: all references are invalid, and values are 0. */

#define GIVE(nothing)                                                                            \
    for (size_t i = 0; i < n_v; i++) v[i] = nothing
#define NO_VARIABLE(type, c_type, wrong_to_set, nothing)                                         \
    GET(fmi3Get##type, c_type, GIVE(nothing); get_unknown(&this, #type, r, n))                   \
    FUNCTION(fmi3Set##type, MASK_Set, wrong_to_set,                                              \
             (void *c, const uint32_t r[], size_t n, const c_type v[], size_t n_v),              \
             set_unknown(&this, #type, r, n))

NO_VARIABLE(Float32, float, wrong_numbers(n, r, v, n_v), 0)
NO_VARIABLE(Int8, int8_t, wrong_numbers(n, r, v, n_v), 0)
NO_VARIABLE(UInt8, uint8_t, wrong_numbers(n, r, v, n_v), 0)
NO_VARIABLE(Int16, int16_t, wrong_numbers(n, r, v, n_v), 0)
NO_VARIABLE(UInt16, uint16_t, wrong_numbers(n, r, v, n_v), 0)
NO_VARIABLE(UInt32, uint32_t, wrong_numbers(n, r, v, n_v), 0)
NO_VARIABLE(UInt64, uint64_t, wrong_numbers(n, r, v, n_v), 0)
NO_VARIABLE(String, string, wrong_numbers(n, r, v, n_v) ? wrong_numbers(n, r, v, n_v)
                                                        : wrong_strings(n, r, v), "")

static string wrong_binaries(size_t n, const uint32_t r[], const size_t sizes[], const void *values,
                             size_t n_values) {
    string wrong = wrong_numbers(n, r, values, n_values);
    return wrong != NULL ? wrong : wrong_values(n, r, sizes);
}

FUNCTION(fmi3GetBinary, MASK_Get, wrong_binaries(n, r, sizes, v, n_v),
         (void *c, const uint32_t r[], size_t n, size_t sizes[], const uint8_t *v[], size_t n_v),
         GIVE(NULL);
         for (size_t i = 0; i < n; i++) sizes[i] = 0;
         get_unknown(&this, "Binary", r, n))
FUNCTION(fmi3SetBinary, MASK_Set, wrong_binaries(n, r, sizes, v, n_v),
         (void *c, const uint32_t r[], size_t n, const size_t sizes[], const uint8_t *const v[],
          size_t n_v),
         set_unknown(&this, "Binary", r, n))
FUNCTION(fmi3GetClock, MASK_Get, wrong_values(n, r, v),
         (void *c, const uint32_t r[], size_t n, boolean v[]),
         for (size_t i = 0; i < n; i++) v[i] = 0;
         get_unknown(&this, "Clock", r, n))
FUNCTION(fmi3SetClock, MASK_Set, wrong_values(n, r, v),
         (void *c, const uint32_t r[], size_t n, const boolean v[]),
         set_unknown(&this, "Clock", r, n))

/* States */

FUNCTION(fmi3GetFMUState, MASK_FMUstate, NULL, (void *c, void **state), get_state(&this, state))
FUNCTION(fmi3SetFMUState, MASK_FMUstate, NULL, (void *c, void *state), set_state(&this, state))
FUNCTION(fmi3FreeFMUState, MASK_FMUstate, NULL, (void *c, void **state), free_state(&this, state))
FUNCTION(fmi3SerializedFMUStateSize, MASK_FMUstate, NULL, (void *c, void *state, size_t *size),
         size_of_state(&this, state, size))
FUNCTION(fmi3SerializeFMUState, MASK_FMUstate, NULL,
         (void *c, void *state, uint8_t bytes[], size_t size),
         serialise_state(&this, state, bytes, size))
FUNCTION(fmi3DeserializeFMUState, MASK_FMUstate, NULL,
         (void *c, const uint8_t bytes[], size_t size, void **state),
         deserialise_state(&this, bytes, size, state))

/* Derivatives */

/* One pass for each known: the equations are not run backwards. */
static void get_adjoint(call *this, const uint32_t unknowns[], size_t n_unknowns,
                        const uint32_t knowns[], size_t n_knowns, const double seed[],
                        double sensitivity[]) {
    directions *along = &this->instance->along;
    size_t n = 0;
    if (!can_differentiate(this, unknowns, n_unknowns, knowns, n_knowns)) return;
    for (size_t i = 0; i < n_knowns; i++) {
        for (uint32_t e = 0; e < span(knowns[i]); e++) {
            double sum = 0.0;
            size_t k = 0;
            memset(along, 0, sizeof *along);
            put_seed(along, knowns[i] + e, 1.0);
            if (!differentiate(this, has_rate(unknowns, n_unknowns))) return;
            for (size_t u = 0; u < n_unknowns; u++) {
                for (uint32_t f = 0; f < span(unknowns[u]); f++) {
                    sum += seed[k++] * slope_of(along, unknowns[u] + f);
                }
            }
            sensitivity[n++] = sum;
        }
    }
    check_slopes(this, sensitivity, n);
}

#define DERIVATIVE(name, get, known, n_known, unknown, n_unknown)                                \
    FUNCTION(name, MASK_Get, NULL,                                                               \
             (void *c, const uint32_t unknowns[], size_t n_unknowns, const uint32_t knowns[],    \
              size_t n_knowns, const double seed[], size_t n_seed, double sensitivity[],         \
              size_t n_sensitivity),                                                             \
             if (check(&this, wrong_numbers(n_knowns, knowns, known, n_known)) &&                \
                 check(&this, wrong_numbers(n_unknowns, unknowns, unknown, n_unknown)))          \
                 get(&this, unknowns, n_unknowns, knowns, n_knowns, seed, sensitivity))

DERIVATIVE(fmi3GetDirectionalDerivative, get_directional, seed, n_seed, sensitivity, n_sensitivity)
DERIVATIVE(fmi3GetAdjointDerivative, get_adjoint, sensitivity, n_sensitivity, seed, n_seed)

/* Model exchange */

EXCHANGED(fmi3EnterEventMode, MASK_EnterEventMode, NULL, (void *c), enter_mode(&this, IN_EVENT))
EXCHANGED(fmi3EnterContinuousTimeMode, MASK_EnterContinuousTimeMode, NULL, (void *c),
          enter_mode(&this, INTEGRATING))
EXCHANGED(fmi3EvaluateDiscreteStates, MASK_EvaluateDiscreteStates, NULL, (void *c), )
EXCHANGED(fmi3UpdateDiscreteStates, MASK_UpdateDiscreteStates,
          needed &&terminate &&nominals &&values &&defined &&next ? NULL : "NULL",
          (void *c, boolean *needed, boolean *terminate, boolean *nominals, boolean *values,
           boolean *defined, double *next),
          *needed = *terminate = *nominals = *defined = 0;
          *next = 0.0; *values = (boolean)update_discrete_states(&this))
EXCHANGED(fmi3CompletedIntegratorStep, MASK_CompletedIntegratorStep,
          event &&terminate ? NULL : "NULL",
          (void *c, boolean no_set, boolean *event, boolean *terminate), *event = *terminate = 0)
EXCHANGED(fmi3SetTime, MASK_SetTime, NULL, (void *c, double time), set_time(&this, time))
EXCHANGED(fmi3SetContinuousStates, MASK_SetContinuousStates, wrong_states(x, n),
          (void *c, const double x[], size_t n), set_continuous_states(&this, x))
EXCHANGED(fmi3GetContinuousStates, MASK_Get, wrong_states(x, n), (void *c, double x[], size_t n),
          get_continuous_states(&this, x))
EXCHANGED(fmi3GetContinuousStateDerivatives, MASK_Get, wrong_states(dx, n),
          (void *c, double dx[], size_t n), get_rates(&this, dx))
EXCHANGED(fmi3GetEventIndicators, MASK_Get, wrong_indicators(z, n), (void *c, double z[], size_t n),
          get_switches(&this, z))
EXCHANGED(fmi3GetNominalsOfContinuousStates, MASK_Get, wrong_states(x, n),
          (void *c, double x[], size_t n), get_nominals(x))
EXCHANGED(fmi3GetNumberOfContinuousStates, MASK_Get, wrong_place(n), (void *c, size_t *n),
          *n = MODEL_RATES)
EXCHANGED(fmi3GetNumberOfEventIndicators, MASK_Get, wrong_place(n), (void *c, size_t *n),
          *n = MODEL_SWITCHES)

/* Unsupported functions */

#define UNSUPPORTED(name, ...)                                                                   \
    FUNCTION(name, MASK_NotSupported, NULL, (__VA_ARGS__), refuse_unsupported(&this, FMI_ERROR))

UNSUPPORTED(fmi3EnterStepMode, void *c)
UNSUPPORTED(fmi3EnterConfigurationMode, void *c)
UNSUPPORTED(fmi3ExitConfigurationMode, void *c)
UNSUPPORTED(fmi3GetNumberOfVariableDependencies, void *c, uint32_t variable, size_t *n)
UNSUPPORTED(fmi3GetVariableDependencies, void *c, uint32_t variable, size_t elements[],
            uint32_t independents[], size_t independent_elements[], int kinds[], size_t n)
UNSUPPORTED(fmi3GetOutputDerivatives, void *c, const uint32_t r[], size_t n, const int32_t orders[],
            double v[], size_t n_v)
UNSUPPORTED(fmi3GetIntervalDecimal, void *c, const uint32_t r[], size_t n, double intervals[],
            int qualifiers[])
UNSUPPORTED(fmi3GetIntervalFraction, void *c, const uint32_t r[], size_t n, uint64_t counters[],
            uint64_t resolutions[], int qualifiers[])
UNSUPPORTED(fmi3GetShiftDecimal, void *c, const uint32_t r[], size_t n, double shifts[])
UNSUPPORTED(fmi3GetShiftFraction, void *c, const uint32_t r[], size_t n, uint64_t counters[],
            uint64_t resolutions[])
UNSUPPORTED(fmi3SetIntervalDecimal, void *c, const uint32_t r[], size_t n, const double intervals[])
UNSUPPORTED(fmi3SetIntervalFraction, void *c, const uint32_t r[], size_t n,
            const uint64_t counters[], const uint64_t resolutions[])
UNSUPPORTED(fmi3SetShiftDecimal, void *c, const uint32_t r[], size_t n, const double shifts[])
UNSUPPORTED(fmi3SetShiftFraction, void *c, const uint32_t r[], size_t n, const uint64_t counters[],
            const uint64_t resolutions[])
UNSUPPORTED(fmi3ActivateModelPartition, void *c, uint32_t clock, double time)
