/* Directional and adjoint derivatives of outputs, states and rates at one time, by inputs, parameters,
 * states and the time.
 *
 * In initialisation they go through the initial state; later the state is held. Hosts ask for
 * Integers and Booleans, too: their derivatives are 0.
 */
#include <math.h>
#include <string.h>

/* The time is a variable in FMI 3.0, after all ports. */
static int is_time(uint32_t reference) {
    return HAS_TIME && reference == FIRST_REFERENCE + N_PORTS;
}

static int is_unknown(uint32_t reference) {
    const port *port = port_at(reference);
    if (port == NULL) return is_continuous_state(reference) || is_rate(reference);
    return port->causality == OUTPUT;
}

/* In initialisation, continuous states follow from the parameters. */
static int is_known(uint32_t reference, mode mode) {
    const port *port = port_at(reference);
    if (port != NULL) return port->causality != OUTPUT;
    return is_time(reference) || (mode != INITIALISING && is_continuous_state(reference));
}

/* Checks references, and brings outputs up to date. */
static int can_differentiate(call *this, const uint32_t unknowns[], size_t n_unknowns,
                             const uint32_t knowns[], size_t n_knowns) {
    instance *it = this->instance;
    message why;
    why.length = 0;
    if (!MODEL_DIFFERENTIABLE) {
        refuse_unsupported(this, FMI_ERROR);
        return 0;
    }
    for (size_t i = 0; i < n_unknowns && why.length == 0; i++) {
        if (!is_unknown(unknowns[i])) {
            compose(&why, "the value reference %u is not of an output, or of a rate", unknowns[i]);
        }
    }
    for (size_t i = 0; i < n_knowns && why.length == 0; i++) {
        if (!is_known(knowns[i], it->run.mode)) {
            compose(&why,
                    "the value reference %u is not of an input, a parameter, or a state that can "
                    "be set",
                    knowns[i]);
        }
    }
    if (why.length == 0 && it->run.mode == INSTANTIATED) {
        compose(&why, "there are no derivatives before the initialisation");
    }
    if (why.length == 0 && it->run.moments[it->run.now].outputs_are == OUTDATED) {
        refresh(it, &why);
    }
    if (why.length > 0) refuse(this, FMI_ERROR, &why, NULL);
    return why.length == 0;
}

static void put_seed(directions *along, uint32_t reference, double seed) {
    const port *port = port_at(reference);
    if (is_time(reference)) {
        along->time += seed;
    } else if (port == NULL) {
        along->state.values[continuous[exchanged_place(reference)]] += seed;
    } else if (port->type != REAL) {
        return;
    } else if (port->causality == INPUT) {
        along->inputs.values[port->place] += seed;
    } else {
        put_parameter(&along->parameters, port, parameter(&along->parameters, port) + seed);
    }
}

/* Returns the derivative of an output, a state or a rate. */
static double slope_of(const directions *along, uint32_t reference) {
    const port *port = port_at(reference);
    int place = exchanged_place(reference);
    if (port != NULL) return port->type == REAL ? along->outputs.values[port->place] : 0.0;
    return place < MODEL_RATES ? along->state.values[continuous[place]]
                               : along->rates[place - MODEL_RATES];
}

/* Rates may be refused where outputs are not. */
static int has_rate(const uint32_t unknowns[], size_t n) {
    for (size_t i = 0; i < n; i++) {
        if (is_rate(unknowns[i])) return 1;
    }
    return 0;
}

/* Computes the derivatives of outputs, and perhaps of rates, along the seeds; returns 0 if that
 * fails. */
static int differentiate(call *this, int with_rates) {
    instance *it = this->instance;
    const run *run = &it->run;
    const moment *now = &run->moments[run->now];
    directions *along = &it->along;
    message why;
    Error error = {0};
    model_differentiate(run->mode == INITIALISING, &it->meant.model, &along->parameters.model,
                        &now->state.groups, &along->state.groups, &run->inputs.groups,
                        &along->inputs.groups, now->time, along->time, now->draws,
                        &along->outputs.groups, with_rates ? along->rates : NULL, &error);
    if (!error.raised) return 1;
    compose(&why, "derivatives refused: %s", error.why.text);
    refuse(this, FMI_ERROR, &why, NULL);
    return 0;
}

/* Discards derivatives that are infinite or undefined. */
static void check_slopes(call *this, const double slopes[], size_t n) {
    for (size_t i = 0; i < n; i++) {
        if (!isfinite(slopes[i]) && this->status == FMI_OK) {
            this->status = FMI_DISCARD;
            log_message(this->instance, FMI_DISCARD, "a derivative is infinite or undefined here");
        }
    }
}

static void get_directional(call *this, const uint32_t unknowns[], size_t n_unknowns,
                            const uint32_t knowns[], size_t n_knowns, const double seed[],
                            double sensitivity[]) {
    directions *along = &this->instance->along;
    size_t k = 0;
    if (!can_differentiate(this, unknowns, n_unknowns, knowns, n_knowns)) return;
    memset(along, 0, sizeof *along);
    for (size_t i = 0; i < n_knowns; i++) {
        for (uint32_t e = 0; e < span(knowns[i]); e++) put_seed(along, knowns[i] + e, seed[k++]);
    }
    if (!differentiate(this, has_rate(unknowns, n_unknowns))) return;
    k = 0;
    for (size_t i = 0; i < n_unknowns; i++) {
        for (uint32_t e = 0; e < span(unknowns[i]); e++) {
            sensitivity[k++] = slope_of(along, unknowns[i] + e);
        }
    }
    check_slopes(this, sensitivity, k);
}
