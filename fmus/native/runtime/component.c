/* The component: the code between the equations and ports of a model and the functions of FMI.
 *
 * fmi2.c and fmi3.c include this file, each in one translation unit, and define NAMED,
 * FIRST_REFERENCE, HAS_TIME, `version` and call_logger. A function of FMI is then
 *
 *     FUNCTION(fmi2Terminate, MASK_Terminate, NULL, (void *c), terminate(&this))
 *
 * guard.c      instances, their messages, and refusals
 * noise.c      Python's random numbers
 * store.c      getting and setting values of ports
 * run.c        modes and steps
 * exchange.c   model exchange, for components with rates
 * state.c      the state as bytes, and the checks before it is restored
 * derivative.c derivatives of outputs
 *
 * docs/reference/fmi-answers.md lists the answers to all calls.
 */
#include "equations.c"
#include "derivatives.c"
#include "identity.h"

typedef enum { REAL, INTEGER, BOOLEAN, ENUMERATION } fmi_type;

/* Names in a version of FMI. */
typedef struct {
    string types[ENUMERATION + 1]; /* types of values */
    int enumerations_are_integers; /* true if functions for Integers pass them */
    string token;                  /* name of the GUID or token */
} names;

static const names version;

/* Limit for messages of an instance, without repeated ones: a host may continue after refusals. */
enum { MOST_MESSAGES = 100 };

/* Ports */

typedef enum { INPUT, OUTPUT, PARAMETER } causality;
typedef enum { CONTINUOUS, DISCRETE, TUNABLE, FIXED } variability;

/* An item of an enumeration. */
typedef struct {
    string text;
    int number;
} choice;

typedef struct {
    string name;
    fmi_type type;
    causality causality;
    variability variability;
    size_t place; /* index among inputs or outputs, or offset of a parameter in its structure */
    double start, minimum, maximum; /* as doubles for all types */
    const choice *choices;
    size_t n_choices;
} port;

/* Consecutive numbers of the state with the same type. */
typedef struct {
    fmi_type type;
    size_t n;
    string name;           /* name of an enumeration; NULL for other types */
    const choice *members; /* its members */
    size_t n_members;
} numbers;

/* The size of an array of n elements; C has no empty arrays. */
#define AT_LEAST_ONE(n) ((n) > 0 ? (n) : 1)

typedef struct {
    model_parameters model;
    double h_max; /* largest internal step [s] */
} parameter_values;

/* All numbers are consecutive doubles, in which integers are exact. */

typedef union {
    model_inputs groups;
    double values[AT_LEAST_ONE(MODEL_INPUTS)];
} input_values;

typedef union {
    model_outputs groups;
    double values[AT_LEAST_ONE(MODEL_OUTPUTS)];
} output_values;

typedef union {
    model_state groups;
    double values[AT_LEAST_ONE(MODEL_STATE)];
} state_values;

#include "noise.c"

/* A run */

/* Freshness of outputs. OUTDATED ones are computed when they are read. A sampled component keeps
 * the outputs of the beginning of a step, which are then HELD; the next step computes its own. */
typedef enum { OUTDATED, HELD, FRESH } freshness;

/* A communication point. */
typedef struct {
    double time;
    state_values state;
    double draws[AT_LEAST_ONE(MODEL_DRAWS)]; /* random numbers for the noise */
    freshness outputs_are;
} moment;

/* Everything that the rest of a run depends on. */
typedef struct {
    mode mode;
    double start_time, stop_time; /* stop_time is infinite if there is none */
    parameter_values parameters; /* as they were set */
    input_values inputs;
    int begun;         /* true if there is a state */
    moment moments[2]; /* the present one, and room for the next, which may be refused */
    int now;
    output_values outputs[2]; /* those that are shown, and room for new ones */
    int shown;
    generator noise;
    int fault;
} run;

/* Derivatives: seeds, and what follows from them. In initialisation the state follows, too. */
typedef struct {
    parameter_values parameters;
    input_values inputs;
    state_values state;
    double time;
    output_values outputs;
    double rates[AT_LEAST_ONE(MODEL_RATES)];
} directions;

struct instance {
    listener host;
    int in_error;
    int exchanges; /* true for model exchange */
    run run;
    parameter_values meant; /* parameters in use */
    double longest_step;
    model_derived derived;
    int underived; /* true if `derived` must be computed before it is used */
    int stale;     /* true if a value has changed that the initial state depends on */
    size_t n_logged;
    uint64_t logged[MOST_MESSAGES];
    state_values restarted; /* for the outputs of a state that is not credible */
    double rates[AT_LEAST_ONE(MODEL_RATES)];
    double switches[AT_LEAST_ONE(MODEL_SWITCHES)];
    /* Values that a call sets, until all are checked. */
    parameter_values set_parameters;
    input_values set_inputs;
    state_values set_state;
    directions along; /* for derivatives */
};

#include "ports.h"

#include "host.c"
#include "handles.c"
#include "calls.c"
#include "guard.c"
#include "store.c"
#include "run.c"
#include "exchange.c"
#include "state.c"
#include "derivative.c"

/* Functions of FMI have arguments that components do not use. */
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
