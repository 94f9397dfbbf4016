/* Model exchange: the host integrates the rates of the continuous states.
 *
 * Its variables are the continuous states, their rates and the event indicators, in this order
 * after all ports. A component without rates does not have them. An instance for co-simulation
 * refuses the functions of model exchange.
 */
#include <string.h>

enum {
    EXCHANGES = MODEL_RATES > 0,
    FIRST_EXCHANGED = FIRST_REFERENCE + N_PORTS + HAS_TIME,
    N_EXCHANGED = 2 * MODEL_RATES + MODEL_SWITCHES
};

/* Makes a new instance one for model exchange. */
static void *for_exchange(void *handle) {
    if (handle == NULL) return NULL;
    call this = begin(handle, "instantiate", ALWAYS);
    if (this.instance != NULL) this.instance->exchanges = 1;
    end(&this);
    return handle;
}

/* True if the instance of a call is for model exchange, and not in error. */
static int is_for_exchange(call *this, int allowed) {
    if (this->instance == NULL) return 0;
    if (!this->instance->exchanges) {
        refuse_unsupported(this, FMI_ERROR);
    } else if (this->instance->in_error && !(allowed & WHEN(AFTER_ERROR))) {
        this->status = FMI_ERROR;
    } else {
        this->allowed = allowed;
        return 1;
    }
    return 0;
}

#define EXCHANGED(name, allowed, wrong, parameters, ...)                                         \
    EXPORT int NAMED(name) parameters {                                                          \
        call this = begin(c, #name, ALWAYS);                                                     \
        if (is_for_exchange(&this, allowed) && check(&this, wrong) && check_mode(&this)) {       \
            __VA_ARGS__;                                                                         \
        }                                                                                        \
        return end(&this);                                                                       \
    }

static string wrong_count(const double values[], size_t n, size_t wanted) {
    return n == wanted ? wrong_size(n, values) : "the numbers of values and of variables differ";
}

static string wrong_states(const double values[], size_t n) {
    return wrong_count(values, n, MODEL_RATES);
}

static string wrong_indicators(const double values[], size_t n) {
    return wrong_count(values, n, MODEL_SWITCHES);
}

/* Discards a call whose values the equations do not take. A solver tries such values, so `fault`
 * stays as it is. */
static void discard(call *this, message *why) {
    this->status = FMI_DISCARD;
    log_once(this->instance, why, FMI_DISCARD, NULL);
}

/* Modes and time */

static void enter_mode(call *this, mode mode) { this->instance->run.mode = mode; }

/* Marks what depends on the present state as outdated. */
static void note_state(instance *it) {
    it->run.moments[it->run.now].outputs_are = OUTDATED;
    if (MODEL_DERIVE_TAKES_STATE) it->underived = 1;
}

static void set_time(call *this, double time) {
    instance *it = this->instance;
    message why;
    if (isfinite(time)) {
        pass_to(it, &it->run.moments[it->run.now], time);
    } else {
        compose(&why, "time %r: must be finite", time);
        fail(this, &why);
    }
}

/* Applies an event to the state, and returns true if a continuous state changes. */
static int update_discrete_states(call *this) {
    instance *it = this->instance;
    run *run = &it->run;
    const moment *now = &run->moments[run->now];
    moment *next = &run->moments[!run->now];
    int changes = 0;
    message why;
    Error error = {0};
    if (!MODEL_HAS_EVENT) return 0;
    *next = *now;
    derive(it, &now->state.groups, now->time, &error);
    if (!error.raised) {
        model_event(&it->meant.model, &next->state.groups, &it->derived, &run->inputs.groups,
                    now->time, &error);
    }
    if (!check_computed(&next->state, &error, &why)) {
        fail(this, &why);
        return 0;
    }
    for (int i = 0; i < MODEL_RATES; i++) {
        changes |= next->state.values[continuous[i]] != now->state.values[continuous[i]];
    }
    run->now = !run->now;
    note_state(it);
    return changes;
}

/* Values */

/* True if there is a state; computes the initial one before. */
static int has_state(call *this) {
    instance *it = this->instance;
    message why;
    if (it->stale && !refresh(it, &why)) refuse(this, FMI_ERROR, &why, NULL);
    return it->run.begun;
}

static void get_continuous_states(call *this, double x[]) {
    const run *run = &this->instance->run;
    int begun = has_state(this);
    const double *state = run->moments[run->now].state.values;
    for (int i = 0; i < MODEL_RATES; i++) x[i] = begun ? state[continuous[i]] : 0.0;
}

static void set_continuous_states(call *this, const double x[]) {
    instance *it = this->instance;
    double *state = it->run.moments[it->run.now].state.values;
    message why;
    if (!all_finite(x, MODEL_RATES)) {
        compose(&why, "continuous states must be finite");
        discard(this, &why);
        return;
    }
    for (int i = 0; i < MODEL_RATES; i++) state[continuous[i]] = x[i];
    note_state(it);
}

/* Equations that are evaluated at the present state. */
typedef void (*law)(const model_parameters *, const model_state *, const model_derived *,
                    const model_inputs *, double, double[], Error *);

static int apply(instance *it, law law, double values[], size_t n, message *why) {
    const moment *now = &it->run.moments[it->run.now];
    Error error = {0};
    derive(it, &now->state.groups, now->time, &error);
    if (!error.raised) {
        law(&it->meant.model, &now->state.groups, &it->derived, &it->run.inputs.groups, now->time,
            values, &error);
    }
    if (error.raised) return compose(why, "%s", error.why.text);
    return all_finite(values, n) || compose(why, "a rate or an event indicator is not finite");
}

static void give(call *this, law law, double values[], size_t n) {
    message why;
    memset(values, 0, n * sizeof *values);
    if (has_state(this) && !apply(this->instance, law, values, n, &why)) discard(this, &why);
}

static void get_rates(call *this, double dx[]) { give(this, model_rates, dx, MODEL_RATES); }

static void get_switches(call *this, double z[]) { give(this, model_switches, z, MODEL_SWITCHES); }

static void get_nominals(double x[]) {
    for (int i = 0; i < MODEL_RATES; i++) x[i] = 1.0;
}

/* Returns the place of a variable of model exchange; -1 for another variable. */
static int exchanged_place(uint32_t reference) {
    int place = (int)(reference - FIRST_EXCHANGED);
    return place >= 0 && place < N_EXCHANGED ? place : -1;
}

static int is_exchanged(uint32_t reference) { return exchanged_place(reference) >= 0; }

static int is_continuous_state(uint32_t reference) {
    int place = exchanged_place(reference);
    return place >= 0 && place < MODEL_RATES;
}

static int is_rate(uint32_t reference) {
    int place = exchanged_place(reference);
    return place >= MODEL_RATES && place < 2 * MODEL_RATES;
}

static double exchanged(call *this, uint32_t reference) {
    instance *it = this->instance;
    int place = exchanged_place(reference);
    if (!has_state(this)) return 0.0;
    if (place < MODEL_RATES) return it->run.moments[it->run.now].state.values[continuous[place]];
    if (!this->rated) {
        /* Once for all values of a call. */
        get_rates(this, it->rates);
        get_switches(this, it->switches);
        this->rated = 1;
    }
    place -= MODEL_RATES;
    return place < MODEL_RATES ? it->rates[place] : it->switches[place - MODEL_RATES];
}

/* Some hosts set states by their references. */
static int is_settable_state(const instance *it, uint32_t reference) {
    return it->exchanges && WHEN(it->run.mode) & EXCHANGING && is_continuous_state(reference);
}

static void set_state_value(instance *it, uint32_t reference, double number) {
    it->set_state.values[continuous[exchanged_place(reference)]] = number;
}

static void take_states(instance *it) {
    it->run.moments[it->run.now].state = it->set_state;
    note_state(it);
}
