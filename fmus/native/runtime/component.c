/* The component: what the equations and ports of a model need to be an FMU.
 *
 * fmi2.c and fmi3.c are written over this, each one translation unit: they define NAMED,
 * FIRST_REFERENCE, `version` and call_logger, and include this file. A function of FMI is then
 *
 *     FUNCTION(fmi2Terminate, MASK_Terminate, NULL, (void *c), terminate(&this))
 *
 * guard.c      an instance, what it logs, and refusals
 * noise.c      Python's random numbers
 * store.c      values of ports, and what may be done with them
 * run.c        modes and steps
 * state.c      the state as bytes, and what is checked before one is taken
 *
 * docs/reference/fmi-answers.md says how each call is answered.
 */
#include "equations.c"
#include "identity.h"

typedef enum { REAL, INTEGER, BOOLEAN, ENUMERATION } fmi_type;

/* What a version calls things. */
typedef struct {
    string types[ENUMERATION + 1]; /* of values */
    int enumerations_are_integers; /* whether they are passed as such */
    string token;                  /* what tells an FMU from others */
} names;

static const names version;

/* Different messages that an instance logs: a host may step on after a refusal for ever. */
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
    size_t place; /* of the value among inputs or outputs, or of a parameter in its structure */
    double start, minimum, maximum; /* as numbers that stand for them */
    const choice *choices;
    size_t n_choices;
} port;

/* Numbers of the state that are alike, one after the other. */
typedef struct {
    fmi_type type;
    size_t n;
    string name;           /* of an enumeration; NULL: they are of none */
    const choice *members; /* of it */
    size_t n_members;
} numbers;

/* An array of n elements, where C has none without elements. */
#define AT_LEAST_ONE(n) ((n) > 0 ? (n) : 1)

typedef struct {
    model_parameters model;
    double h_max; /* largest internal step [s] */
} parameter_values;

/* All numbers lie side by side as doubles, in which integers are exact. */

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

/* Of outputs. Those that are outdated are computed when they are read. A sampled component holds
 * those of the beginning of a step after it; the next step computes its own. */
typedef enum { OUTDATED, HELD, FRESH } freshness;

/* A communication point. */
typedef struct {
    double time;
    state_values state;
    double draws[AT_LEAST_ONE(MODEL_DRAWS)]; /* that the noise is made of */
    freshness outputs_are;
} moment;

/* Everything that the rest of a run depends on. */
typedef struct {
    mode mode;
    double start_time, stop_time; /* infinite: there is none */
    parameter_values parameters; /* as they were set */
    input_values inputs;
    int begun;         /* whether there is a state */
    moment moments[2]; /* one is now; the other takes the next, which may be refused */
    int now;
    output_values outputs[2]; /* one is shown; the other takes what is computed */
    int shown;
    generator noise;
    int fault;
} run;

struct instance {
    listener host;
    int in_error;
    run run;
    parameter_values meant; /* the parameters that steps are taken with */
    double longest_step;
    model_derived derived;
    int underived; /* whether it is to be derived again before it is used */
    int stale;     /* whether a value has changed that the state at the start time depends on */
    size_t n_logged;
    uint64_t logged[MOST_MESSAGES];
    state_values restarted; /* for the outputs of a state that is not credible */
    /* What a call sets, until all of it is found good. */
    parameter_values set_parameters;
    input_values set_inputs;
};

#include "ports.h"

#include "host.c"
#include "handles.c"
#include "calls.c"
#include "guard.c"
#include "store.c"
#include "run.c"
#include "state.c"

/* Functions of FMI take more than a component has to know. */
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
