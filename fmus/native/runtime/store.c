/* Values of ports, what may be done with them, and what is refused.
 *
 * A port's value reference is its place in the table. All Real inputs and all Real outputs lie
 * side by side, in their order, so that a host that passes them all in one call costs one
 * comparison.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Lets parameters act from the next step, if they fit together. */
static int adopt(instance *it, const parameter_values *values, message *why);

/* Computes state and outputs at the start time, if a value they depend on has changed. */
static void refresh(instance *it);

/* Refusals */

static refusal **find_refusal(run *it, string what) {
    refusal **place = &it->refused;
    while (*place != NULL && strcmp((*place)->what, what) != 0) place = &(*place)->next;
    return place;
}

/* Notes a refusal, in the place of one of the same thing. 0: no memory. */
static int note_refusal(run *it, string what, string why) {
    refusal **place = find_refusal(it, what), *before = *place;
    refusal *noted = malloc(sizeof *noted + strlen(what) + strlen(why) + 1);
    if (noted == NULL) return 0;
    noted->next = before == NULL ? NULL : before->next;
    noted->why = strcpy(strcpy(noted->what, what) + strlen(what) + 1, why);
    *place = noted;
    free(before);
    return 1;
}

static void mend(run *it, string what) {
    if (it->refused == NULL) return;
    refusal **place = find_refusal(it, what), *mended = *place;
    if (mended == NULL) return;
    *place = mended->next;
    free(mended);
}

static void release_run(run *it) {
    for (refusal *next; it->refused != NULL; it->refused = next) {
        next = it->refused->next;
        free(it->refused);
    }
}

/* Whether a refusal can be of something. */
static int can_be_refused(string what) {
    if (strcmp(what, REFERENCE) == 0 || strcmp(what, INITIALISATION) == 0) return 1;
    for (int i = 0; version.refused[i] != NULL; i++) {
        if (strcmp(what, version.refused[i]) == 0) return 1;
    }
    for (int i = 0; i < N_PORTS; i++) {
        if (strcmp(what, ports[i].name) == 0) return 1;
    }
    return 0;
}

/* Raises `fault` and logs. */
static void report(instance *it, message *said, string key) {
    it->run.fault = 1;
    say(it, said, FMI_DISCARD, key);
}

/* Takes no step until what was refused is mended. */
static void refuse(instance *it, string what, message *why) {
    if (!note_refusal(&it->run, what, why->text)) it->no_memory = 1;
    report(it, why, NULL);
}

/* Ports */

static void refuse_reference(instance *it, string kind, uint32_t reference) {
    message why;
    compose(&why, "no %s has the value reference %u", kind, reference);
    refuse(it, REFERENCE, &why);
}

/* The port of a type that has a value reference. */
static const port *port_of(uint32_t reference, kind kind) {
    return reference < N_PORTS && ports[reference].kind == kind ? &ports[reference] : NULL;
}

/* The text that a number stands for; NULL: none. */
static string text_of(const port *port, double number) {
    for (size_t i = 0; i < port->n_choices; i++) {
        if (port->choices[i].number == number) return port->choices[i].text;
    }
    return NULL;
}

static int has_choice(const port *port, string text, double *number, message *why) {
    for (size_t i = 0; i < port->n_choices; i++) {
        *number = port->choices[i].number;
        if (strcmp(port->choices[i].text, text) == 0) return 1;
    }
    compose(why, "%s = %q: use one of ", port->name, text);
    for (size_t i = 0; i < port->n_choices; i++) {
        append_text(why, i > 0 ? ", " : "");
        append_text(why, port->choices[i].text);
    }
    return 0;
}

/* Whether a port that takes numbers can take one. */
static int in_range(const port *port, double number, message *why) {
    if (!isfinite(number)) {
        compose(why, "%s = %r: must be finite", port->name, number);
    } else if (number < port->minimum) {
        compose(why, "%s = %g: must be at least %g", port->name, number, port->minimum);
    } else if (number > port->maximum) {
        compose(why, "%s = %g: must be at most %g", port->name, number, port->maximum);
    } else {
        return 1;
    }
    return 0;
}

/* A parameter, as the number that it is or that stands for it. */
static double parameter(const parameter_values *values, const port *port) {
    const char *place = (const char *)values + port->place;
    double real;
    int integer;
    if (port->kind == REAL) {
        memcpy(&real, place, sizeof real);
        return real;
    }
    memcpy(&integer, place, sizeof integer);
    return integer;
}

static void put_parameter(parameter_values *values, const port *port, double number) {
    char *place = (char *)values + port->place;
    if (port->kind == REAL) {
        memcpy(place, &number, sizeof number);
    } else {
        int integer = (int)number;
        memcpy(place, &integer, sizeof integer);
    }
}

/* Getting */

/* The value of a port as a number; 0.0, and a refusal, if no port of the type has the reference. */
static double number_of(instance *it, uint32_t reference, kind kind) {
    const port *port = port_of(reference, kind);
    if (port == NULL) {
        refuse_reference(it, version.kinds[kind], reference);
        return 0.0;
    }
    if (port->causality == PARAMETER) return parameter(&it->run.parameters, port);
    if (port->causality == INPUT) return it->run.inputs.values[port->place];
    if (port->kind == BOOLEAN) return it->run.fault;
    return it->run.moments[it->run.now].outputs.values[port->place];
}

/* Whether references are those of all inputs, or outputs, in their order. */
static int are_all(const uint32_t references[], const uint32_t all[], size_t n) {
    return n > 0 && memcmp(references, all, n * sizeof *all) == 0;
}

static void get_reals(instance *it, const uint32_t references[], size_t n, double values[]) {
    if (it->stale) refresh(it);
    if (n == MODEL_OUTPUTS && are_all(references, output_references, n)) {
        memcpy(values, it->run.moments[it->run.now].outputs.values, n * sizeof *values);
        return;
    }
    for (size_t i = 0; i < n; i++) values[i] = number_of(it, references[i], REAL);
}

static int32_t get_integer(instance *it, uint32_t reference) {
    return (int32_t)number_of(it, reference, INTEGER);
}

static int get_boolean(instance *it, uint32_t reference) {
    if (it->stale) refresh(it);
    return number_of(it, reference, BOOLEAN) != 0.0;
}

static string get_string(instance *it, uint32_t reference) {
    double number = number_of(it, reference, STRING);
    const port *port = port_of(reference, STRING);
    return port == NULL ? "" : text_of(port, number);
}

/* Setting */

/* A value is a number, or a text. */
static int change(instance *it, const port *port, double number, string text, message *why) {
    run *run = &it->run;
    parameter_values changed;
    if (port->causality == OUTPUT) {
        compose(why, "%s is an output and cannot be set", port->name);
    } else if (run->mode == TERMINATED) {
        compose(why, "%s cannot be set after %s", port->name, version.terminate);
    } else if (port->variability == FIXED && run->mode == STEPPING) {
        compose(why, "%s is fixed and cannot be set after the initialisation", port->name);
    } else if (text != NULL ? has_choice(port, text, &number, why) : in_range(port, number, why)) {
        if (port->causality == INPUT) {
            run->inputs.values[port->place] = number;
            return 1;
        }
        changed = run->parameters;
        put_parameter(&changed, port, number);
        if (run->mode == STEPPING && !adopt(it, &changed, why)) return 0;
        run->parameters = changed;
        return 1;
    }
    return 0;
}

static void set_value(instance *it, uint32_t reference, kind kind, double number, string text) {
    const port *port = port_of(reference, kind);
    message why;
    if (port == NULL) {
        refuse_reference(it, version.kinds[kind], reference);
    } else if (change(it, port, number, text, &why)) {
        mend(&it->run, port->name);
        it->stale = it->run.mode == INITIALISING;
    } else {
        refuse(it, port->name, &why);
    }
}

static int all_finite(const double values[], size_t n) {
    for (size_t i = 0; i < n; i++) {
        if (!isfinite(values[i])) return 0;
    }
    return 1;
}

static void set_reals(instance *it, const uint32_t references[], size_t n, const double values[]) {
    run *run = &it->run;
    if (n == MODEL_INPUTS && run->mode == STEPPING && run->refused == NULL &&
        are_all(references, input_references, n) && all_finite(values, n)) {
        memcpy(run->inputs.values, values, n * sizeof *values);
        return;
    }
    for (size_t i = 0; i < n; i++) set_value(it, references[i], REAL, values[i], NULL);
}

static void set_integer(instance *it, uint32_t reference, int32_t integer) {
    set_value(it, reference, INTEGER, integer, NULL);
}

static void set_boolean(instance *it, uint32_t reference, int boolean) {
    set_value(it, reference, BOOLEAN, boolean != 0, NULL);
}

static void set_string(instance *it, uint32_t reference, string text) {
    set_value(it, reference, STRING, 0.0, text);
}
