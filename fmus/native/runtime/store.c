/* Getting and setting values of ports.
 *
 * The value reference of a port gives its index in the table. Real inputs and Real outputs are
 * stored first, in the order of their references, so that a call that passes all of them takes one
 * comparison of the references.
 */
#include <math.h>
#include <string.h>

/* Uses parameters from the next step on, if they do not contradict each other. */
static int adopt(instance *it, const parameter_values *values, message *why);

/* Computes the outputs, and before that the initial state if a value that it depends on has
 * changed. */
static int refresh(instance *it, message *why);

/* Variables of model exchange: continuous states, their rates and event indicators. */
static int is_exchanged(uint32_t reference);
static double exchanged(call *this, uint32_t reference);

/* True for a continuous state that the host may set; sets it after all values are checked. */
static int is_settable_state(const instance *it, uint32_t reference);
static void set_state_value(instance *it, uint32_t reference, double number);

/* Makes the states that were set the present ones. */
static void take_states(instance *it);

/* Ports */

static const char NO_PORT[] = "no %s has the value reference %u";

/* Returns the port with a value reference, or NULL. */
static const port *port_at(uint32_t reference) {
    uint32_t place = reference - FIRST_REFERENCE;
    return place < N_PORTS ? &ports[place] : NULL;
}

/* True if functions for a type pass the values of a port. */
static int passes_as(const port *port, fmi_type type) {
    return port->type == type || (type == INTEGER && port->type == ENUMERATION &&
                                  version.enumerations_are_integers);
}

/* Returns the text of a number among n choices, or NULL. */
static string text_among(const choice choices[], size_t n, double number) {
    for (size_t i = 0; i < n; i++) {
        if (choices[i].number == number) return choices[i].text;
    }
    return NULL;
}

static int check_finite(const port *port, double number, message *why) {
    return isfinite(number) || compose(why, "%s = %r: must be finite", port->name, number);
}

/* Checks that a port can take a number. */
static int check_range(const port *port, double number, message *why) {
    if (!check_finite(port, number, why)) return 0;
    if (port->n_choices > 0 && text_among(port->choices, port->n_choices, number) == NULL) {
        compose(why, "%s = %.0f: use one of ", port->name, number);
        for (size_t i = 0; i < port->n_choices; i++) {
            const choice *it = &port->choices[i];
            message one;
            compose(&one, i > 0 ? ", %.0f (%s)" : "%.0f (%s)", (double)it->number, it->text);
            append_text(why, one.text);
        }
    } else if (number < port->minimum) {
        compose(why, "%s = %g: must be at least %g", port->name, number, port->minimum);
    } else if (number > port->maximum) {
        compose(why, "%s = %g: must be at most %g", port->name, number, port->maximum);
    } else {
        return 1;
    }
    return 0;
}

/* Returns the value of a parameter. */
static double parameter(const parameter_values *values, const port *port) {
    const char *place = (const char *)values + port->place;
    double real;
    int integer;
    if (port->type == REAL) {
        memcpy(&real, place, sizeof real);
        return real;
    }
    memcpy(&integer, place, sizeof integer);
    return integer;
}

static void put_parameter(parameter_values *values, const port *port, double number) {
    char *place = (char *)values + port->place;
    if (port->type == REAL) {
        memcpy(place, &number, sizeof number);
    } else {
        int integer = (int)number;
        memcpy(place, &integer, sizeof integer);
    }
}

/* Getting */

/* Refuses references for a type that no port has; `type` is its name in this version. */
static void get_unknown(call *this, string type, const uint32_t references[], size_t n) {
    message why;
    for (size_t i = 0; i < n; i++) {
        compose(&why, NO_PORT, type, references[i]);
        refuse(this, FMI_ERROR, &why, NULL);
    }
}

/* `fault` is the output that is not in the equations' groups. */
static int is_fault(const port *port) { return port == &ports[N_PORTS - 1]; }

/* Returns the value of a port as a double; 0.0 if no port of the type has the reference. */
static double number_of(call *this, uint32_t reference, fmi_type type) {
    const run *run = &this->instance->run;
    const port *port = port_at(reference);
    if (port == NULL || (type != REAL && !passes_as(port, type))) {
        if (type == REAL && is_exchanged(reference)) return exchanged(this, reference);
        get_unknown(this, version.types[type], &reference, 1);
        return 0.0;
    }
    if (port->causality == PARAMETER) return parameter(&run->parameters, port);
    if (port->causality == INPUT) return run->inputs.values[port->place];
    if (is_fault(port)) return run->fault;
    return run->outputs[run->shown].values[port->place];
}

/* True if references name all inputs, or all outputs, in order. */
static int are_all(const uint32_t references[], const uint32_t all[], size_t n) {
    return n > 0 && memcmp(references, all, n * sizeof *all) == 0;
}

static int has_output(const uint32_t references[], size_t n) {
    for (size_t i = 0; i < n; i++) {
        const port *port = port_at(references[i]);
        if (port != NULL && port->causality == OUTPUT && !is_fault(port)) return 1;
    }
    return 0;
}

/* Before getting values: brings outputs up to date. */
static void prepare_to_get(call *this, const uint32_t references[], size_t n) {
    instance *it = this->instance;
    message why;
    if (it->run.moments[it->run.now].outputs_are != OUTDATED) return;
    if (has_output(references, n) && !refresh(it, &why)) refuse(this, FMI_ERROR, &why, NULL);
}

/* Gets all Real outputs at once if the references name them; otherwise returns false. */
static int get_all_reals(call *this, const uint32_t references[], size_t n, double values[]) {
    const run *run = &this->instance->run;
    if (n != REAL_OUTPUTS || !are_all(references, output_references, n)) return 0;
    memcpy(values, run->outputs[run->shown].values, n * sizeof *values);
    return 1;
}

/* Functions for Reals get values of all types. */
static double get_real(call *this, uint32_t reference) {
    return number_of(this, reference, REAL);
}

static int32_t get_integer(call *this, uint32_t reference) {
    return (int32_t)number_of(this, reference, INTEGER);
}

static int get_boolean(call *this, uint32_t reference) {
    return number_of(this, reference, BOOLEAN) != 0.0;
}

/* Setting */

/* Marks the values that depend on inputs or parameters, which have changed, as outdated. */
static void note_change(instance *it, int inputs, int parameters) {
    moment *now = &it->run.moments[it->run.now];
    if (it->run.mode == INITIALISING) {
        it->stale = 1;
        now->outputs_are = OUTDATED;
    } else if (it->run.mode >= STEPPING) {
        if (inputs && MODEL_OUTPUTS_TAKE_INPUTS) now->outputs_are = OUTDATED;
        if (inputs && MODEL_DERIVE_TAKES_INPUTS) it->underived = 1;
        if (parameters && MODEL_OUTPUTS_TAKE_PARAMETERS) now->outputs_are = OUTDATED;
    }
}

/* The values of a call, which the instance keeps until all are checked: all are accepted, or none.
 * They are set one by one between the beginning and the end of a setting. */
typedef struct {
    call *call;
    int good;
    int has_parameters;
    int changes_inputs, changes_parameters, changes_states;
} setting;

static void set_unknown(call *this, string type, const uint32_t references[], size_t n) {
    message why;
    if (n == 0) return;
    compose(&why, NO_PORT, type, references[0]);
    fail(this, &why);
}

static setting begin_setting(call *this, fmi_type type, const uint32_t references[], size_t n) {
    instance *instance = this->instance;
    setting it = {this, 1, 0, 0, 0, 0};
    for (size_t i = 0; i < n && it.good; i++) {
        const port *port = port_at(references[i]);
        if (port != NULL && passes_as(port, type)) {
            it.has_parameters |= port->causality == PARAMETER;
        } else if (type == REAL && is_settable_state(instance, references[i])) {
            it.changes_states = 1;
        } else {
            set_unknown(this, version.types[type], &references[i], 1);
            it.good = 0;
        }
    }
    if (it.has_parameters) instance->set_parameters = instance->run.parameters;
    instance->set_inputs = instance->run.inputs;
    if (it.changes_states) instance->set_state = instance->run.moments[instance->run.now].state;
    return it;
}

static int is_settled(const run *run, const port *port) {
    return port->variability == FIXED && run->mode >= STEPPING;
}

/* Checks that the standard allows setting a port now; a fixed one may be set to its own value. */
static int check_settable(const run *run, const port *port, double number, message *why) {
    if (port->causality == OUTPUT) {
        return compose(why, "%s is an output and cannot be set", port->name);
    }
    return !is_settled(run, port) || number == parameter(&run->parameters, port) ||
           compose(why, "%s is fixed and cannot change after initialisation", port->name);
}

/* A run must not begin with another parameter than the host wanted. */
static void refuse_setting(setting *it, message *why) {
    it->good = 0;
    if (it->has_parameters && it->call->instance->run.mode < STEPPING) {
        it->call->instance->run.fault = 1;
        fail(it->call, why);
    } else {
        refuse(it->call, FMI_DISCARD, why, NULL);
    }
}

static void set_value(setting *it, uint32_t reference, double number) {
    instance *instance = it->call->instance;
    const port *port = port_at(reference);
    message why;
    if (!it->good) return;
    if (port == NULL) {
        if (isfinite(number)) {
            set_state_value(instance, reference, number);
        } else {
            compose(&why, "continuous states must be finite");
            refuse_setting(it, &why);
        }
        return;
    }
    if (!check_settable(&instance->run, port, number, &why)) {
        it->good = 0;
        fail(it->call, &why);
    } else if (is_settled(&instance->run, port)) {
        return;
    } else if (!check_range(port, number, &why)) {
        refuse_setting(it, &why);
    } else if (port->causality == INPUT) {
        instance->set_inputs.values[port->place] = number;
        it->changes_inputs = 1;
    } else {
        put_parameter(&instance->set_parameters, port, number);
        it->changes_parameters = 1;
    }
}

static void end_setting(setting *it) {
    instance *instance = it->call->instance;
    run *run = &instance->run;
    message why;
    if (!it->good) return;
    if (it->changes_parameters && run->mode >= STEPPING &&
        !adopt(instance, &instance->set_parameters, &why)) {
        refuse_setting(it, &why);
        return;
    }
    if (it->changes_parameters) run->parameters = instance->set_parameters;
    run->inputs = instance->set_inputs;
    if (it->changes_states) take_states(instance);
    note_change(instance, it->changes_inputs, it->changes_parameters);
}

static int all_finite(const double values[], size_t n) {
    for (size_t i = 0; i < n; i++) {
        if (!isfinite(values[i])) return 0;
    }
    return 1;
}

/* Sets all Real inputs at once if the references name them; otherwise returns false. */
static int set_all_reals(call *this, const uint32_t references[], size_t n, const double values[]) {
    run *run = &this->instance->run;
    if (n != REAL_INPUTS || INPUTS_HAVE_RANGES || run->mode < STEPPING ||
        !are_all(references, input_references, n) || !all_finite(values, n)) {
        return 0;
    }
    memcpy(run->inputs.values, values, n * sizeof *values);
    note_change(this->instance, 1, 0);
    return 1;
}

/* Loops over the references and values of a call */

/* Returns the number of values of a reference: 1 for a scalar, or the elements of an array, which
 * has the reference of its first element. */
static size_t span(uint32_t reference) {
#ifdef ARRAYS
    uint32_t place = reference - FIRST_REFERENCE;
    return place < N_PORTS ? elements[place] : 1;
#else
    (void)reference;
    return 1;
#endif
}

#define FOR_EACH(action)                                                                         \
    for (size_t i = 0, k = 0; i < n; i++) {                                                      \
        for (size_t e = 0; e < span(r[i]); e++, k++) {                                           \
            uint32_t reference = r[i] + (uint32_t)e;                                             \
            action;                                                                              \
        }                                                                                        \
    }
#define GET_EACH(get) FOR_EACH(v[k] = get(&this, reference))
#define SET_EACH(type, number)                                                                   \
    setting it = begin_setting(&this, type, r, n);                                               \
    FOR_EACH(set_value(&it, reference, (double)(number)));                                       \
    end_setting(&it)
