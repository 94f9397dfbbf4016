/* Modes and steps.
 *
 * A step is a transaction: it computes the next moment, which becomes the present one if all its
 * values are finite. Outputs are computed when they are read; if no input changes them, they are
 * computed at the end of a step, so that an error refuses the step. A sampled component computes
 * the outputs of the beginning of a step, and keeps them.
 */
#include <float.h>
#include <math.h>
#include <string.h>

/* Resets a run to the values after instantiation. */
static void renew_run(run *it) {
    memset(it, 0, sizeof *it);
    it->stop_time = INFINITY;
    it->parameters.h_max = INFINITY; /* unless there is such a parameter */
    for (int i = 0; i < N_PORTS; i++) {
        if (ports[i].causality == PARAMETER) {
            put_parameter(&it->parameters, &ports[i], ports[i].start);
        } else if (ports[i].causality == INPUT) {
            it->inputs.values[ports[i].place] = ports[i].start;
        }
    }
    it->moments[it->now].outputs_are = FRESH;
}

static void renew(instance *it) {
    renew_run(&it->run);
    it->stale = 0;
    it->in_error = 0;
    it->n_logged = 0;
}

static int adopt(instance *it, const parameter_values *values, message *why) {
    Error error = {0};
    model_check(&values->model, &error);
    if (error.raised) return compose(why, "%s", error.why.text);
    it->meant = *values;
    it->longest_step = fmin(values->h_max * (1.0 + ROUNDING), DBL_MAX);
    it->underived = 1;
    return 1;
}

static int is_bounded(const state_values *state) {
    double sum = 0.0;
    for (int i = 0; i < MODEL_STATE; i++) sum += state->values[i] * state->values[i];
    return sum <= LARGEST_STATE * LARGEST_STATE;
}

/* Checks that a number of the state is a member of its enumeration, if it has one. */
static int check_member(const numbers *of, double number, message *why) {
    return of->name == NULL || text_among(of->members, of->n_members, number) != NULL ||
           compose(why, "%.0f is not of type %s", number, of->name);
}

static int check_members(const double values[], message *why) {
    for (size_t i = 0; i < N_STATE_NUMBERS; values += state_numbers[i++].n) {
        for (size_t k = 0; state_numbers[i].name != NULL && k < state_numbers[i].n; k++) {
            if (!check_member(&state_numbers[i], values[k], why)) return 0;
        }
    }
    return 1;
}

/* Checks a computed state. */
static int check_computed(const state_values *state, const Error *error, message *why) {
    if (error->raised) return compose(why, "%s", error->why.text);
    return check_members(state->values, why) &&
           (MODEL_CHECKS_STATES || is_bounded(state) ||
            compose(why, "the state is not finite, or exceeds %g", LARGEST_STATE));
}

static void draw(generator *noise, double draws[]) {
    for (int i = 0; i < MODEL_DRAWS; i++) draws[i] = standard_normal(noise);
}

/* Computes the derived values, unless nothing that they depend on has changed. */
static void derive(instance *it, const model_state *state, double time, Error *error) {
    if (!it->underived) return;
    model_derive(&it->meant.model, state, &it->run.inputs.groups, time, &it->derived, error);
    it->underived = error->raised;
}

/* Computes the outputs of a moment, without showing them. */
static int evaluate(instance *it, const moment *of, message *why) {
    output_values *outputs = &it->run.outputs[!it->run.shown];
    const model_parameters *parameters = &it->meant.model;
    const model_inputs *inputs = &it->run.inputs.groups;
    const model_state *state = &of->state.groups;
    Error error;
    error.raised = 0;
    if (MODEL_HAS_GUARD && !model_credible(parameters, state, inputs, &error) && !error.raised) {
        it->restarted = of->state;
        state = &it->restarted.groups;
        model_restart(parameters, &it->restarted.groups, inputs, &error);
    }
    if (MODEL_OUTPUTS_TAKE_DERIVED) derive(it, state, of->time, &error);
    model_evaluate(parameters, state, &it->derived, inputs, of->time, &outputs->groups, &error);
    if (error.raised) return compose(why, "%s", error.why.text);
    if (MODEL_DRAWS > 0) {
        model_measure(parameters, of->draws, &outputs->groups, &error);
        if (error.raised) return compose(why, "%s", error.why.text);
    }
    for (int i = 0; i < REAL_OUTPUTS; i++) {
        if (!isfinite(outputs->values[i])) {
            return check_finite(port_at(output_references[i]), outputs->values[i], why);
        }
    }
    return 1;
}

/* Initialisation and end */

/* Computes the state and the outputs at the start time. */
static int start(instance *it, message *why) {
    run *run = &it->run;
    moment *next = &run->moments[!run->now];
    Error error = {0};
    if (!adopt(it, &run->parameters, why)) return 0;
    if (MODEL_DRAWS > 0) {
        seed_generator(&run->noise, (uint32_t)model_seed(&it->meant.model, &error));
        draw(&run->noise, next->draws);
        /* Without communication points there is no noise. */
        if (it->exchanges) memset(next->draws, 0, sizeof next->draws);
    }
    next->time = run->start_time;
    model_start(&it->meant.model, &run->inputs.groups, next->time, &next->state.groups, &error);
    if (!check_computed(&next->state, &error, why) || !evaluate(it, next, why)) return 0;
    next->outputs_are = FRESH;
    run->now = !run->now;
    run->shown = !run->shown;
    run->begun = 1;
    return 1;
}

static int refresh(instance *it, message *why) {
    run *run = &it->run;
    moment *now = &run->moments[run->now];
    message said;
    if (!it->stale) {
        if (!evaluate(it, now, &said)) {
            run->fault = 1;
            return compose(why, "outputs refused: %s", said.text);
        }
        now->outputs_are = FRESH;
        run->shown = !run->shown;
        return 1;
    }
    it->stale = !start(it, &said);
    if (!it->stale) return 1;
    run->begun = 0;
    memset(&run->outputs[run->shown], 0, sizeof run->outputs[run->shown]);
    return compose(why, "initialisation refused: %s", said.text);
}

/* Sets the times; a stop time that is not after the start means that there is none. */
static void set_experiment(call *this, double start, double stop) {
    run *run = &this->instance->run;
    message why;
    if (isfinite(start)) {
        run->start_time = run->moments[run->now].time = start;
        run->stop_time = stop > start ? stop : INFINITY;
    } else {
        compose(&why, "start time %r: must be finite", start);
        fail(this, &why);
    }
}

static void enter_initialisation(call *this) {
    this->instance->run.mode = INITIALISING;
    note_change(this->instance, 0, 0);
}

static void exit_initialisation(call *this) {
    message why;
    if (this->instance->stale && !refresh(this->instance, &why)) {
        fail(this, &why);
    } else {
        this->instance->run.mode = this->instance->exchanges ? IN_EVENT : STEPPING;
    }
}

static void terminate(call *this) { this->instance->run.mode = TERMINATED; }

/* Steps */

/* Returns the number of internal steps; -1 if the step is refused. */
static int internal_steps(double time, double step, double longest, message *why) {
    if (!isfinite(time) || !isfinite(step)) {
        compose(why, "time %r and step %r must be finite", time, step);
    } else if (step < 0.0) {
        compose(why, "step %g s is negative", step);
    } else if (step / longest > MOST_INTERNAL_STEPS) {
        compose(why,
                "step %g s needs more than %.0f internal steps; take shorter ones, or raise h_max",
                step, MOST_INTERNAL_STEPS);
    } else {
        return (int)ceil(step / longest);
    }
    return -1;
}

/* Returns the end of a step: a multiple of the step, if its beginning is one. */
static double end_of_step(double start, double time, double step) {
    double k = nearbyint((time - start) / step);
    return time == start + k * step ? start + (k + 1.0) * step : time + step;
}

/* Copies what drawing n normal numbers may change. Each takes two words, in pairs. The words
 * themselves change only when all are used. */
static inline void copy_for(generator *copy, const generator *it, uint32_t n) {
    copy->place = it->place;
    copy->has_next = it->has_next;
    copy->next = it->next;
    if (it->place + 2 * (n + 1) > GENERATOR_WORDS) memcpy(copy->words, it->words, sizeof it->words);
}

/* Changes the time of a moment, and marks what depends on it as outdated. */
static inline void pass_to(instance *it, moment *of, double time) {
    if (of->time == time) return;
    of->time = time;
    if (MODEL_OUTPUTS_TAKE_TIME) of->outputs_are = OUTDATED;
    if (MODEL_DERIVE_TAKES_TIME) it->underived = 1;
}

/* Computes the next moment, and makes it the present one if all its values are valid. */
static int advance(instance *it, double time, double step, message *why) {
    run *run = &it->run;
    moment *next = &run->moments[!run->now];
    model_state *state = &next->state.groups;
    const model_parameters *parameters = &it->meant.model;
    const model_inputs *inputs = &run->inputs.groups;
    generator before;
    message said;
    Error error;
    int n = 1, shown = run->shown;
    if (!(step > 0.0 && step <= it->longest_step && isfinite(time))) {
        n = internal_steps(time, step, it->longest_step, why);
        if (n <= 0) return n == 0;
    }
    *next = run->moments[run->now];
    pass_to(it, next, time);
    if (MODEL_SAMPLED && next->outputs_are != FRESH) {
        if (!evaluate(it, next, why)) return 0;
        shown = !shown;
    }
    error.raised = 0;
    if (MODEL_HAS_GUARD && !model_credible(parameters, state, inputs, &error) && !error.raised) {
        model_restart(parameters, state, inputs, &error);
        if (!error.raised) {
            compose(&said, MODEL_RESTARTED, time);
            log_once(it, &said, FMI_WARNING, MODEL_RESTARTED);
        }
    }
    double h = step / n;
    for (int i = 0; i < n && !error.raised; i++) {
        double t = time + i * h;
        if (MODEL_UPDATE_TAKES_DERIVED) derive(it, state, t, &error);
        model_update(parameters, state, &it->derived, inputs, t, h, &error);
        if (MODEL_DERIVE_TAKES_STATE || MODEL_DERIVE_TAKES_TIME) it->underived = 1;
    }
    if (!check_computed(&next->state, &error, why)) return 0;
    next->time = time + step;
    if (MODEL_OUTPUTS_TAKE_TIME || MODEL_DERIVE_TAKES_TIME) {
        next->time = end_of_step(run->start_time, time, step);
    }
    next->outputs_are = MODEL_SAMPLED ? HELD : OUTDATED;
    if (MODEL_DRAWS > 0) {
        copy_for(&before, &run->noise, MODEL_DRAWS);
        draw(&run->noise, next->draws);
    }
    if (!MODEL_SAMPLED && !MODEL_OUTPUTS_TAKE_INPUTS) {
        if (!evaluate(it, next, why)) {
            if (MODEL_DRAWS > 0) copy_for(&run->noise, &before, MODEL_DRAWS);
            return 0;
        }
        next->outputs_are = FRESH;
        shown = !shown;
    }
    run->now = !run->now;
    run->shown = shown;
    return 1;
}

/* Returns the end of the last successful step. */
static double time_of(const call *this) {
    const run *run = &this->instance->run;
    return run->moments[run->now].time;
}

/* True if a step ends after the stop time, except for rounding errors of a host that adds steps. */
static int ends_too_late(double end, double start, double stop) {
    return end > stop && end > stop + ROUNDING * fmax(fabs(start), fabs(stop));
}

static void take_step(call *this, double time, double step) {
    instance *it = this->instance;
    message why, said;
    if (ends_too_late(time + step, it->run.start_time, it->run.stop_time)) {
        compose(&why, "step from %g s to %g s: the stop time is %g s", time, time + step,
                it->run.stop_time);
        fail(this, &why);
    } else if (!advance(it, time, step, &why)) {
        it->underived = 1;
        compose(&said, "step refused at t = %g s: %s", time, why.text);
        refuse(this, FMI_DISCARD, &said, why.text);
    }
}
