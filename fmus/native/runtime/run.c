/* Modes and steps.
 *
 * A step is a transaction: state and outputs change together, after everything was computed and
 * found finite.
 */
#include <math.h>
#include <string.h>

/* Longest step of a component that has no internal steps [s]. */
static const double NO_LIMIT = 1e300;

/* Makes a run what it is after instantiation. */
static void renew_run(run *it) {
    memset(it, 0, sizeof *it);
    it->parameters.h_max = NO_LIMIT;
    for (int i = 0; i < N_PORTS; i++) {
        if (ports[i].causality == PARAMETER) {
            put_parameter(&it->parameters, &ports[i], ports[i].start);
        } else if (ports[i].causality == INPUT) {
            it->inputs.values[ports[i].place] = ports[i].start;
        }
    }
}

/* Makes everything what it is after instantiation. */
static void renew(instance *it) {
    renew_run(&it->run);
    it->stale = 0;
    it->in_error = 0;
    it->n_said = 0;
    it->last_successful_time = 0.0;
}

static int adopt(instance *it, const parameter_values *values, message *why) {
    Error error = {0};
    model_check(&values->model, &error);
    if (error.raised) return compose(why, "%s", error.why.text);
    it->meant = *values;
    it->longest_step = values->h_max * (1.0 + ROUNDING);
    it->underived = 1;
    return 1;
}

static int bounded(const state_values *state) {
    double sum = 0.0;
    for (int i = 0; i < MODEL_STATE; i++) sum += state->values[i] * state->values[i];
    return sum <= LARGEST_STATE * LARGEST_STATE;
}

/* Whether a number of the state is one that its enumeration has, if it is of one. */
static int is_member(const numbers *of, double number, message *why) {
    return of->name == NULL || text_among(of->members, of->n_members, number) != NULL ||
           compose(why, "%.0f is not of type %s", number, of->name);
}

static int has_members(const double values[], message *why) {
    for (size_t i = 0; i < N_STATE_NUMBERS; values += state_numbers[i++].n) {
        for (size_t k = 0; state_numbers[i].name != NULL && k < state_numbers[i].n; k++) {
            if (!is_member(&state_numbers[i], values[k], why)) return 0;
        }
    }
    return 1;
}

/* Gives outputs their noise. */
static int measure(instance *it, output_values *outputs, message *why) {
    double draws[AT_LEAST_ONE(MODEL_DRAWS)];
    Error error;
    for (int i = 0; i < MODEL_DRAWS; i++) draws[i] = standard_normal(&it->run.noise);
    error.raised = 0;
    model_measure(&it->meant.model, draws, &outputs->groups, &error);
    if (error.raised) return compose(why, "%s", error.why.text);
    return all_finite(outputs->values, MODEL_OUTPUTS) ||
           compose(why, "a sampled output is not finite");
}

/* Takes over what was computed for the next moment, if no number of it is out of bounds. */
static int accept(instance *it, const Error *error, message *why) {
    run *run = &it->run;
    moment *next = &run->moments[!run->now];
    if (error->raised) return compose(why, "%s", error->why.text);
    if (!has_members(next->state.values, why)) return 0;
    if (!bounded(&next->state)) {
        return compose(why, "the state is not finite, or exceeds %g", LARGEST_STATE);
    }
    for (int i = 0; i < REAL_OUTPUTS; i++) {
        if (!isfinite(next->outputs.values[i])) {
            return is_finite(port_at(output_references[i]), next->outputs.values[i], why);
        }
    }
    if (MODEL_DRAWS > 0) {
        generator before;
        copy_for(&before, &run->noise, MODEL_DRAWS);
        if (!measure(it, &next->outputs, why)) {
            copy_for(&run->noise, &before, MODEL_DRAWS);
            return 0;
        }
    }
    run->now = !run->now;
    run->begun = 1;
    it->underived = 0;
    return 1;
}

/* Initialisation and end */

/* State and outputs at the start time. */
static int start(instance *it, message *why) {
    run *run = &it->run;
    moment *next = &run->moments[!run->now];
    Error error = {0};
    if (!adopt(it, &run->parameters, why)) return 0;
    if (MODEL_DRAWS > 0) {
        seed_generator(&run->noise, (uint32_t)model_seed(&it->meant.model, &error));
    }
    model_begin(&it->meant.model, &run->inputs.groups, run->start_time, &next->state.groups,
                &next->outputs.groups, &error);
    return accept(it, &error, why);
}

static int refresh(instance *it, message *why) {
    run *run = &it->run;
    message said;
    if (!it->stale) return 1;
    if (start(it, &said)) {
        it->stale = 0;
        return 1;
    }
    run->begun = 0;
    memset(&run->moments[run->now].outputs, 0, sizeof run->moments[run->now].outputs);
    return compose(why, "initialisation refused: %s", said.text);
}

static int follows(call *this, mode mode) {
    static const string names[] = {"instantiated", "initialising", "stepping", "terminated"};
    instance *it = this->instance;
    message why;
    if (it->run.mode == mode) return 1;
    compose(&why, "%s is not allowed when %s", this->function, names[it->run.mode]);
    fail(this, &why);
    return 0;
}

static void set_experiment(call *this, double start) {
    run *run = &this->instance->run;
    message why;
    if (!follows(this, INSTANTIATED)) return;
    if (isfinite(start)) {
        run->start_time = run->time = this->instance->last_successful_time = start;
    } else {
        compose(&why, "start time %r: must be finite", start);
        fail(this, &why);
    }
}

static void enter_initialisation(call *this) {
    if (!follows(this, INSTANTIATED)) return;
    this->instance->run.mode = INITIALISING;
    this->instance->stale = 1;
}

static void exit_initialisation(call *this) {
    message why;
    if (!follows(this, INITIALISING)) return;
    if (refresh(this->instance, &why)) {
        this->instance->run.mode = STEPPING;
    } else {
        fail(this, &why);
    }
}

static void terminate(call *this) { this->instance->run.mode = TERMINATED; }

static void reset(call *this) { renew(this->instance); }

/* Steps */

/* The number of internal steps that a step is split into; -1: it is refused. */
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

static int advance(instance *it, double time, double step, message *why) {
    run *run = &it->run;
    const moment *now = &run->moments[run->now];
    moment *next = &run->moments[!run->now];
    const model_parameters *parameters = &it->meant.model;
    const model_inputs *inputs = &run->inputs.groups;
    message said;
    Error error;
    int n = 1;
    if (!(step > 0.0 && step <= it->longest_step && isfinite(time))) {
        n = internal_steps(time, step, it->longest_step, why);
        if (n <= 0) return n == 0;
    }
    error.raised = 0;
    next->state = now->state;
    int credible = model_credible(parameters, &now->state.groups, inputs, &error);
    if (!credible && !error.raised) {
        compose(&said, MODEL_RESTARTED, time);
        say(it, &said, FMI_WARNING, MODEL_RESTARTED);
        model_restart(parameters, &next->state.groups, inputs, &error);
    } else if (it->underived) {
        model_derive(parameters, &next->state.groups, &error);
    }
    model_advance(parameters, &next->state.groups, inputs, time, step / n, n,
                  &next->outputs.groups, &error);
    if (!accept(it, &error, why)) return 0;
    run->time = time + step;
    return 1;
}

static void take_step(call *this, double time, double step) {
    instance *it = this->instance;
    message why, said;
    if (!follows(this, STEPPING)) return;
    if (advance(it, time, step, &why)) {
        it->last_successful_time = time + step;
    } else {
        compose(&said, "step refused at t = %g s: %s", time, why.text);
        discard(this, &said, why.text);
    }
}
