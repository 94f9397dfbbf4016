/* The functions of FMI 3.0, and the one file to compile: it includes all others.
 *
 * What co-simulation without events, clocks and derivatives does not need is not supported,
 * and answered with fmi3Error.
 */
#include "component.h"

#include <math.h>

static const names version = {
    .types = {"Float64", "Int32", "Boolean", "Enumeration"},
    .token = "instantiation token",
};

/* Value references are places among the variables, from 1: some hosts take them for indices. */
enum { FIRST_REFERENCE = 1 };

#include "component.c"

#if defined(FMI3_FUNCTION_PREFIX) && !defined(FMI3_OVERRIDE_FUNCTION_PREFIX)
#define FMI3(name) PREFIXED(FMI3_FUNCTION_PREFIX, name)
#else
#define FMI3(name) name
#endif

/* fmi3Boolean and fmi3Clock. A host may pass any byte, where a bool is 0 or 1. */
typedef uint8_t boolean;

/* The variable for the time comes after all others. */
enum { TIME = FIRST_REFERENCE + N_PORTS };

/* Messages */

typedef void (*fmi3_logger)(void *environment, int status, string category, string text);

/* A # stands before the reference of a variable, unless it is doubled. */
static void call_logger(const logger *host, string name, int status, string category, string text) {
    char doubled[2 * MOST_TEXT + 1];
    copy_doubled(doubled, text, '#');
    ((fmi3_logger)host->function)(host->environment, status, category, doubled);
}

/* Turns the named categories on or off, and leaves the others as they are; no names: all. */
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

EXPORT int FMI3(fmi3SetDebugLogging)(void *handle, boolean on, size_t n, const string names[]) {
    call this = begin(handle, "fmi3SetDebugLogging", MASK_SetDebugLogging);
    if (GOES_ON(this, wrong_texts(n, names))) switch_categories(&this, on, n, names);
    return end(&this);
}

/* Making and freeing */

EXPORT string FMI3(fmi3GetVersion)(void) { return "3.0"; }

EXPORT void *FMI3(fmi3InstantiateCoSimulation)(
    string name, string token, string resources, boolean visible, boolean logging,
    boolean event_mode_used, boolean early_return_allowed, const uint32_t intermediate[],
    size_t n_intermediate, void *environment, fmi3_logger log, void (*update)(void)) {
    return instantiate("fmi3InstantiateCoSimulation",
                       event_mode_used ? "this FMU has no event mode" : NULL, name, token,
                       (logger){(void (*)(void))log, environment}, logging != 0);
}

static const char ANOTHER_TYPE[] = "this FMU is for co-simulation only";

EXPORT void *FMI3(fmi3InstantiateModelExchange)(string name, string token, string resources,
                                                boolean visible, boolean logging,
                                                void *environment, fmi3_logger log) {
    return instantiate("fmi3InstantiateModelExchange", ANOTHER_TYPE, name, token,
                       (logger){(void (*)(void))log, environment}, logging != 0);
}

EXPORT void *FMI3(fmi3InstantiateScheduledExecution)(
    string name, string token, string resources, boolean visible, boolean logging,
    void *environment, fmi3_logger log, void (*update)(void *), void (*lock)(void),
    void (*unlock)(void)) {
    return instantiate("fmi3InstantiateScheduledExecution", ANOTHER_TYPE, name, token,
                       (logger){(void (*)(void))log, environment}, logging != 0);
}

EXPORT void FMI3(fmi3FreeInstance)(void *handle) { free_instance(handle, "fmi3FreeInstance"); }

/* Modes */

EXPORT int FMI3(fmi3EnterInitializationMode)(void *handle, boolean has_tolerance, double tolerance,
                                             double start, boolean has_stop, double stop) {
    call this = begin(handle, "fmi3EnterInitializationMode", MASK_EnterInitializationMode);
    if (GOES_ON(this, NULL)) {
        set_experiment(&this, start, has_stop ? stop : INFINITY);
        if (this.status == FMI_OK) enter_initialisation(&this);
    }
    return end(&this);
}

#define MODE(name, allowed, action)                                                              \
    EXPORT int FMI3(name)(void *handle) {                                                        \
        call this = begin(handle, #name, allowed);                                               \
        if (GOES_ON(this, NULL)) action(&this);                                                  \
        return end(&this);                                                                       \
    }

MODE(fmi3ExitInitializationMode, MASK_ExitInitializationMode, exit_initialisation)
MODE(fmi3Terminate, MASK_Terminate, terminate)
MODE(fmi3Reset, MASK_Reset, reset)

/* Steps */

EXPORT int FMI3(fmi3DoStep)(void *handle, double time, double step, boolean no_set,
                            boolean *event_handling_needed, boolean *terminate_simulation,
                            boolean *early_return, double *last_successful_time) {
    call this = begin(handle, "fmi3DoStep", MASK_DoStep);
    int complete = event_handling_needed && terminate_simulation && early_return &&
                   last_successful_time;
    if (GOES_ON(this, complete ? NULL : "NULL")) {
        take_step(&this, time, step);
        *event_handling_needed = *terminate_simulation = *early_return = 0;
        *last_successful_time = time_of(&this);
    }
    return end(&this);
}

/* Values. A reference stands for a scalar, or for an array: that of its first element. */

#ifdef ARRAYS
static size_t span(uint32_t reference) {
    uint32_t place = reference - FIRST_REFERENCE;
    return place < N_PORTS ? elements[place] : 1;
}
#else
#define span(reference) ((size_t)1)
#endif

static string wrong_numbers(size_t n, const uint32_t r[], const void *values, size_t n_values) {
    size_t wanted = 0;
    for (size_t i = 0; i < n; i++) wanted += r == NULL ? 1 : span(r[i]);
    return wanted == n_values ? wrong_values(n, r, values)
                              : "the numbers of values and of references differ";
}

#define FOR_EACH(action)                                                                         \
    for (size_t i = 0, k = 0; i < n; i++) {                                                      \
        for (size_t e = 0; e < span(r[i]); e++, k++) {                                           \
            uint32_t reference = r[i] + (uint32_t)e;                                             \
            action;                                                                              \
        }                                                                                        \
    }

#define GET(name, type, get)                                                                     \
    EXPORT int FMI3(name)(void *handle, const uint32_t r[], size_t n, type v[], size_t n_v) {   \
        call this = begin(handle, #name, MASK_Get);                                              \
        if (GOES_ON(this, wrong_numbers(n, r, v, n_v))) {                                        \
            prepare_to_get(&this, r, n);                                                         \
            FOR_EACH(v[k] = get(&this, reference));                                              \
        }                                                                                        \
        return end(&this);                                                                       \
    }

#define SET(name, c_type, type, number)                                                          \
    EXPORT int FMI3(name)(void *handle, const uint32_t r[], size_t n, const c_type v[],         \
                          size_t n_v) {                                                          \
        call this = begin(handle, #name, MASK_Set);                                              \
        if (GOES_ON(this, wrong_numbers(n, r, v, n_v))) {                                        \
            setting it = begin_setting(&this, type, r, n);                                       \
            FOR_EACH(set_value(&it, reference, (double)(number)));                               \
            end_setting(&it);                                                                    \
        }                                                                                        \
        return end(&this);                                                                       \
    }

static int64_t get_enumeration(call *this, uint32_t reference) {
    return (int64_t)number_of(this, reference, ENUMERATION);
}

GET(fmi3GetInt32, int32_t, get_integer)
GET(fmi3GetBoolean, boolean, get_boolean)
GET(fmi3GetInt64, int64_t, get_enumeration)
SET(fmi3SetInt32, int32_t, INTEGER, v[k])
SET(fmi3SetBoolean, boolean, BOOLEAN, v[k] != 0)
SET(fmi3SetInt64, int64_t, ENUMERATION, v[k])

#ifdef ARRAYS
static double get_float(call *this, uint32_t reference) {
    return reference == TIME ? time_of(this) : number_of(this, reference, REAL);
}

GET(fmi3GetFloat64, double, get_float)
SET(fmi3SetFloat64, double, REAL, v[k])
#else
EXPORT int FMI3(fmi3GetFloat64)(void *handle, const uint32_t r[], size_t n, double v[],
                                size_t n_v) {
    call this = begin(handle, "fmi3GetFloat64", MASK_Get);
    if (GOES_ON(this, wrong_numbers(n, r, v, n_v))) {
        for (size_t i = 0, from = 0; i <= n; i++) {
            if (i < n && r[i] != TIME) continue;
            if (i > from) get_reals(&this, &r[from], i - from, &v[from]);
            if (i < n) v[i] = time_of(&this);
            from = i + 1;
        }
    }
    return end(&this);
}

EXPORT int FMI3(fmi3SetFloat64)(void *handle, const uint32_t r[], size_t n, const double v[],
                                size_t n_v) {
    call this = begin(handle, "fmi3SetFloat64", MASK_Set);
    if (GOES_ON(this, wrong_numbers(n, r, v, n_v))) set_reals(&this, r, n, v);
    return end(&this);
}
#endif

/* Types that no variable has: every reference is a wrong one, for which 0 is given. */

static int get_none(void *handle, string function, string type, const uint32_t r[], size_t n,
                    string wrong) {
    call this = begin(handle, function, MASK_Get);
    if (GOES_ON(this, wrong)) get_unknown(&this, type, r, n);
    return end(&this);
}

static int set_none(void *handle, string function, string type, const uint32_t r[], size_t n,
                    string wrong) {
    call this = begin(handle, function, MASK_Set);
    if (GOES_ON(this, wrong)) set_unknown(&this, type, r, n);
    return end(&this);
}

#define NO_VARIABLE(type, c_type)                                                                \
    EXPORT int FMI3(fmi3Get##type)(void *handle, const uint32_t r[], size_t n, c_type v[],       \
                                   size_t n_v) {                                                 \
        string wrong = wrong_numbers(n, r, v, n_v);                                              \
        for (size_t i = 0; i < n && wrong == NULL; i++) v[i] = 0;                                \
        return get_none(handle, "fmi3Get" #type, #type, r, n, wrong);                            \
    }                                                                                            \
    EXPORT int FMI3(fmi3Set##type)(void *handle, const uint32_t r[], size_t n, const c_type v[], \
                                   size_t n_v) {                                                 \
        return set_none(handle, "fmi3Set" #type, #type, r, n, wrong_numbers(n, r, v, n_v));      \
    }

NO_VARIABLE(Float32, float)
NO_VARIABLE(Int8, int8_t)
NO_VARIABLE(UInt8, uint8_t)
NO_VARIABLE(Int16, int16_t)
NO_VARIABLE(UInt16, uint16_t)
NO_VARIABLE(UInt32, uint32_t)
NO_VARIABLE(UInt64, uint64_t)

EXPORT int FMI3(fmi3GetString)(void *handle, const uint32_t r[], size_t n, string v[],
                               size_t n_v) {
    string wrong = wrong_numbers(n, r, v, n_v);
    for (size_t i = 0; i < n && wrong == NULL; i++) v[i] = "";
    return get_none(handle, "fmi3GetString", "String", r, n, wrong);
}

EXPORT int FMI3(fmi3SetString)(void *handle, const uint32_t r[], size_t n, const string v[],
                               size_t n_v) {
    string wrong = wrong_numbers(n, r, v, n_v);
    return set_none(handle, "fmi3SetString", "String", r, n,
                    wrong != NULL ? wrong : wrong_strings(n, r, v));
}

static string wrong_binaries(size_t n, const uint32_t r[], const size_t sizes[], const void *values,
                             size_t n_values) {
    string wrong = wrong_numbers(n, r, values, n_values);
    return wrong != NULL ? wrong : wrong_values(n, r, sizes);
}

EXPORT int FMI3(fmi3GetBinary)(void *handle, const uint32_t r[], size_t n, size_t sizes[],
                               const uint8_t *v[], size_t n_v) {
    string wrong = wrong_binaries(n, r, sizes, v, n_v);
    for (size_t i = 0; i < n && wrong == NULL; i++) {
        v[i] = NULL;
        sizes[i] = 0;
    }
    return get_none(handle, "fmi3GetBinary", "Binary", r, n, wrong);
}

EXPORT int FMI3(fmi3SetBinary)(void *handle, const uint32_t r[], size_t n, const size_t sizes[],
                               const uint8_t *const v[], size_t n_v) {
    return set_none(handle, "fmi3SetBinary", "Binary", r, n, wrong_binaries(n, r, sizes, v, n_v));
}

EXPORT int FMI3(fmi3GetClock)(void *handle, const uint32_t r[], size_t n, boolean v[]) {
    string wrong = wrong_values(n, r, v);
    for (size_t i = 0; i < n && wrong == NULL; i++) v[i] = 0;
    return get_none(handle, "fmi3GetClock", "Clock", r, n, wrong);
}

EXPORT int FMI3(fmi3SetClock)(void *handle, const uint32_t r[], size_t n, const boolean v[]) {
    return set_none(handle, "fmi3SetClock", "Clock", r, n, wrong_values(n, r, v));
}

/* States */

#define STATE_FUNCTION(name, parameters, action)                                                 \
    EXPORT int FMI3(name) parameters {                                                           \
        call this = begin(handle, #name, MASK_FMUstate);                                         \
        if (GOES_ON(this, NULL)) action;                                                         \
        return end(&this);                                                                       \
    }

STATE_FUNCTION(fmi3GetFMUState, (void *handle, void **state), get_state(&this, state))
STATE_FUNCTION(fmi3SetFMUState, (void *handle, void *state), set_state(&this, state))
STATE_FUNCTION(fmi3FreeFMUState, (void *handle, void **state), free_state(&this, state))
STATE_FUNCTION(fmi3SerializedFMUStateSize, (void *handle, void *state, size_t *size),
               size_of_state(&this, state, size))
STATE_FUNCTION(fmi3SerializeFMUState, (void *handle, void *state, uint8_t bytes[], size_t size),
               serialise_state(&this, state, bytes, size))
STATE_FUNCTION(fmi3DeserializeFMUState,
               (void *handle, const uint8_t bytes[], size_t size, void **state),
               deserialise_state(&this, bytes, size, state))

/* What is not supported */

static int unsupported(void *handle, string function) {
    call this = begin(handle, function, MASK_NotSupported);
    if (GOES_ON(this, NULL)) refuse_unsupported(&this, FMI_ERROR);
    return end(&this);
}

#define UNSUPPORTED(name, ...)                                                                   \
    EXPORT int FMI3(name)(void *handle, __VA_ARGS__) { return unsupported(handle, #name); }
#define UNSUPPORTED_MODE(name)                                                                   \
    EXPORT int FMI3(name)(void *handle) { return unsupported(handle, #name); }

UNSUPPORTED_MODE(fmi3EnterEventMode)
UNSUPPORTED_MODE(fmi3EnterStepMode)
UNSUPPORTED_MODE(fmi3EnterContinuousTimeMode)
UNSUPPORTED_MODE(fmi3EnterConfigurationMode)
UNSUPPORTED_MODE(fmi3ExitConfigurationMode)
UNSUPPORTED_MODE(fmi3EvaluateDiscreteStates)
UNSUPPORTED(fmi3UpdateDiscreteStates, boolean *needed, boolean *terminate, boolean *nominals,
            boolean *values, boolean *defined, double *next)
UNSUPPORTED(fmi3GetNumberOfVariableDependencies, uint32_t variable, size_t *n)
UNSUPPORTED(fmi3GetVariableDependencies, uint32_t variable, size_t elements[],
            uint32_t independents[], size_t independent_elements[], int kinds[], size_t n)
UNSUPPORTED(fmi3GetOutputDerivatives, const uint32_t r[], size_t n, const int32_t orders[],
            double v[], size_t n_v)
UNSUPPORTED(fmi3GetDirectionalDerivative, const uint32_t unknowns[], size_t n_unknowns,
            const uint32_t knowns[], size_t n_knowns, const double seed[], size_t n_seed,
            double sensitivity[], size_t n_sensitivity)
UNSUPPORTED(fmi3GetAdjointDerivative, const uint32_t unknowns[], size_t n_unknowns,
            const uint32_t knowns[], size_t n_knowns, const double seed[], size_t n_seed,
            double sensitivity[], size_t n_sensitivity)
UNSUPPORTED(fmi3GetIntervalDecimal, const uint32_t r[], size_t n, double intervals[],
            int qualifiers[])
UNSUPPORTED(fmi3GetIntervalFraction, const uint32_t r[], size_t n, uint64_t counters[],
            uint64_t resolutions[], int qualifiers[])
UNSUPPORTED(fmi3GetShiftDecimal, const uint32_t r[], size_t n, double shifts[])
UNSUPPORTED(fmi3GetShiftFraction, const uint32_t r[], size_t n, uint64_t counters[],
            uint64_t resolutions[])
UNSUPPORTED(fmi3SetIntervalDecimal, const uint32_t r[], size_t n, const double intervals[])
UNSUPPORTED(fmi3SetIntervalFraction, const uint32_t r[], size_t n, const uint64_t counters[],
            const uint64_t resolutions[])
UNSUPPORTED(fmi3SetShiftDecimal, const uint32_t r[], size_t n, const double shifts[])
UNSUPPORTED(fmi3SetShiftFraction, const uint32_t r[], size_t n, const uint64_t counters[],
            const uint64_t resolutions[])
UNSUPPORTED(fmi3ActivateModelPartition, uint32_t clock, double time)
UNSUPPORTED(fmi3CompletedIntegratorStep, boolean no_set, boolean *event, boolean *terminate)
UNSUPPORTED(fmi3SetTime, double time)
UNSUPPORTED(fmi3SetContinuousStates, const double states[], size_t n)
UNSUPPORTED(fmi3GetContinuousStateDerivatives, double derivatives[], size_t n)
UNSUPPORTED(fmi3GetEventIndicators, double indicators[], size_t n)
UNSUPPORTED(fmi3GetContinuousStates, double states[], size_t n)
UNSUPPORTED(fmi3GetNominalsOfContinuousStates, double nominals[], size_t n)
UNSUPPORTED(fmi3GetNumberOfEventIndicators, size_t *n)
UNSUPPORTED(fmi3GetNumberOfContinuousStates, size_t *n)
