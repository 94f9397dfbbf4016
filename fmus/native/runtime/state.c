/* The state of an FMU: complete, exact, as bytes, and checked before it is taken.
 *
 * It is held in memory as the bytes that it is serialised to:
 *
 *     MAGIC, identity, mode, start time, stop time, time,
 *     parameters in the order of their ports, inputs, Reals before others,
 *     whether there is a state, and if so: the numbers of the state; of the noise the words of the
 *     generator, the place of the next, whether there is a next number, and it, and what is drawn;
 *     of a sampled component the outputs, Reals before others, and what they are;
 *     fault;
 *     the CRC-32 of all that.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char MAGIC[] = "FMU state 3";

/* Tells states of one model and version from all others. */
static const char IDENTITY[] = MODEL_NAME " " MODEL_GUID;

/* No normal number that is drawn is larger: it is made of 53 bits. */
static const double LARGEST_DRAW = 9.0;

enum { CHECKSUM_SIZE = 4 };

typedef struct {
    size_t size;
    int sealed; /* whether the checksum stands where it belongs: it is computed when it is needed */
    unsigned char bytes[1];
} saved;

/* Writing */

static void put_noise(writer *to, const generator *noise, const double draws[]) {
    for (int i = 0; i < GENERATOR_WORDS; i++) put_word(to, noise->words[i]);
    put_word(to, noise->place);
    put_word(to, (uint32_t)noise->has_next);
    put_real(to, noise->has_next ? noise->next : 0.0);
    put_numbers(to, REAL, draws, MODEL_DRAWS);
}

static void put_run(writer *to, const run *it) {
    const moment *now = &it->moments[it->now];
    put_text(to, MAGIC);
    put_text(to, IDENTITY);
    put_word(to, it->mode);
    put_real(to, it->start_time);
    put_real(to, it->stop_time);
    put_real(to, now->time);
    for (int i = 0; i < N_PORTS; i++) {
        if (ports[i].causality != PARAMETER) continue;
        double number = parameter(&it->parameters, &ports[i]);
        put_numbers(to, ports[i].type, &number, 1);
    }
    put_values(to, it->inputs.values, REAL_INPUTS, MODEL_INPUTS);
    put_word(to, (uint32_t)it->begun);
    if (it->begun) {
        put_state(to, now->state.values);
        if (MODEL_DRAWS > 0) put_noise(to, &it->noise, now->draws);
        if (MODEL_SAMPLED) {
            put_values(to, it->outputs[it->shown].values, REAL_OUTPUTS, MODEL_OUTPUTS);
            put_word(to, now->outputs_are);
        }
    }
    put_word(to, (uint32_t)it->fault);
}

static size_t content_size(const saved *state) {
    return state->size < CHECKSUM_SIZE ? 0 : state->size - CHECKSUM_SIZE;
}

static void seal(saved *state) {
    writer to = {state->bytes, content_size(state)};
    put_word(&to, crc32(state->bytes, to.size));
    state->sealed = 1;
}

static int has_its_checksum(const saved *state) {
    size_t size = content_size(state);
    reader from = {.bytes = state->bytes + size, .left = CHECKSUM_SIZE};
    return take_word(&from) == crc32(state->bytes, size);
}

/* Reading */

static int is_truth(double number) { return number == 0.0 || number == 1.0; }

/* Whether a number can be a port's; an output is in no range, as no step looks at one. */
static int check_value(const port *port, double number, message *why) {
    if (port->type == BOOLEAN && !is_truth(number)) {
        return compose(why, "%s: must be a Boolean", port->name);
    }
    return port->causality == OUTPUT ? check_finite(port, number, why)
                                     : check_range(port, number, why);
}

static int check_values(const double values[], size_t n, const uint32_t references[],
                        message *why) {
    for (size_t i = 0; i < n; i++) {
        if (!check_value(port_at(references[i]), values[i], why)) return 0;
    }
    return 1;
}

static int take_parameter(reader *from, parameter_values *values, const port *port, message *why) {
    double number;
    take_numbers(from, port->type, &number, 1);
    if (!check_value(port, number, why)) return 0;
    put_parameter(values, port, number);
    return 1;
}

/* Whether a number can be one of the state. */
static int check_number(const numbers *of, double number, message *why) {
    if (of->type == REAL) return isfinite(number) || compose(why, "a value is not finite");
    if (of->type == BOOLEAN && !is_truth(number)) {
        return compose(why, "%.0f is not of type bool", number);
    }
    return check_member(of, number, why);
}

static int take_state(reader *from, double values[], message *why) {
    for (size_t i = 0; i < N_STATE_NUMBERS; values += state_numbers[i++].n) {
        take_numbers(from, state_numbers[i].type, values, state_numbers[i].n);
        for (size_t k = 0; k < state_numbers[i].n; k++) {
            if (!check_number(&state_numbers[i], values[k], why)) return 0;
        }
    }
    return 1;
}

static int can_be_drawn(double number) { return fabs(number) <= LARGEST_DRAW; }

static int take_noise(reader *from, generator *noise, double draws[], message *why) {
    for (int i = 0; i < GENERATOR_WORDS; i++) noise->words[i] = take_word(from);
    noise->place = take_word(from);
    noise->has_next = take_truth(from);
    noise->next = take_real(from);
    take_numbers(from, REAL, draws, MODEL_DRAWS);
    if (noise->place > GENERATOR_WORDS || noise->has_next < 0) {
        return compose(why, "its noise generator has an invalid state");
    }
    int good = can_be_drawn(noise->next);
    for (int i = 0; i < MODEL_DRAWS; i++) good &= can_be_drawn(draws[i]);
    return good || compose(why, "its noise is none that can be drawn");
}

/* The outputs that a sampled component keeps. */
static int take_sample(reader *from, run *it, message *why) {
    double *values = it->outputs[it->shown].values;
    take_values(from, values, REAL_OUTPUTS, MODEL_OUTPUTS);
    uint32_t number = take_word(from);
    if (number > FRESH) return compose(why, "its outputs are neither fresh nor not");
    it->moments[it->now].outputs_are = (freshness)number;
    return check_values(values, MODEL_OUTPUTS, output_references, why);
}

/* A saved run, checked part by part. */
static int take_run(reader *from, run *it, message *why) {
    moment *now = &it->moments[it->now];
    uint32_t number = take_word(from);
    if (number > TERMINATED) return compose(why, "%u is not a mode", number);
    it->mode = (mode)number;
    it->start_time = take_real(from);
    it->stop_time = take_real(from);
    now->time = take_real(from);
    if (!isfinite(it->start_time) || isnan(now->time)) {
        return compose(why, "a value is not finite");
    }
    if (!(it->stop_time > it->start_time)) {
        return compose(why, "its stop time is not after its start time");
    }
    if (it->mode < STEPPING && now->time != it->start_time) {
        return compose(why, "its time is not its start time");
    }
    for (int i = 0; i < N_PORTS; i++) {
        if (ports[i].causality == PARAMETER &&
            !take_parameter(from, &it->parameters, &ports[i], why)) {
            return 0;
        }
    }
    take_values(from, it->inputs.values, REAL_INPUTS, MODEL_INPUTS);
    if (!check_values(it->inputs.values, MODEL_INPUTS, input_references, why)) return 0;
    it->begun = take_truth(from);
    if (it->mode == INSTANTIATED && it->begun) {
        return compose(why, "it has a state before the initialisation");
    }
    if (!it->begun && it->mode == STEPPING) {
        return compose(why, "it has steps without a state");
    }
    if (it->begun) {
        now->outputs_are = OUTDATED;
        if (!take_state(from, now->state.values, why)) return 0;
        if (MODEL_DRAWS > 0 && !take_noise(from, &it->noise, now->draws, why)) return 0;
        if (MODEL_SAMPLED && !take_sample(from, it, why)) return 0;
    }
    it->fault = take_truth(from);
    if (it->fault < 0) return compose(why, "its fault is neither true nor false");
    return (!from->short_of && from->left == 0 && it->begun >= 0) ||
           compose(why, "it has missing or unknown parts");
}

/* Whether a run can have led to a state, whose numbers are finite. */
static int check_reachable(const run *it, message *why) {
    const model_parameters *parameters = &it->parameters.model;
    const state_values *state = &it->moments[it->now].state;
    Error error = {0};
    model_check(parameters, &error);
    if (!error.raised && !is_bounded(state)) return compose(why, "it exceeds %g", LARGEST_STATE);
    model_check_state(parameters, &state->groups, &error);
    return !error.raised || compose(why, "%s", error.why.text);
}

/* How many bytes a state has at most; `it` is a new run. */
static size_t largest_size(run *it) {
    writer to = {NULL, CHECKSUM_SIZE};
    it->begun = 1;
    put_run(&to, it);
    it->begun = 0;
    return to.size;
}

/* Makes a new run what was saved. */
static int take_saved(const saved *state, run *it, message *why) {
    reader from = {.bytes = state->bytes, .left = content_size(state)};
    if (!take_this(&from, MAGIC)) return compose(why, "the bytes are not a state");
    if (state->size > largest_size(it)) return compose(why, "it has missing or unknown parts");
    if (state->sealed && !has_its_checksum(state)) {
        return compose(why, "the bytes were changed since they were written");
    }
    if (!take_this(&from, IDENTITY)) return compose(why, "not a state of %s", IDENTITY);
    return take_run(&from, it, why) && (!it->begun || check_reachable(it, why));
}

static int restore(instance *it, const saved *state, message *why) {
    run *wanted = malloc(sizeof *wanted);
    if (wanted == NULL) return compose(why, "out of memory");
    renew_run(wanted);
    int good = take_saved(state, wanted, why) &&
               (!wanted->begun || adopt(it, &wanted->parameters, why));
    if (good) {
        it->run = *wanted;
        it->stale = 0;
        /* Before the first step all follows from parameters and inputs: it is computed again. */
        note_change(it, 0, 0);
    }
    free(wanted);
    return good;
}

/* What the host does with states */

static void free_saved(instance *it, void *saved) {
    (void)it;
    free(saved);
}

/* A state with room for some bytes; NULL: no memory. */
static saved *new_saved(size_t size) {
    saved *made = malloc(sizeof *made + size);
    if (made != NULL) *made = (saved){.size = size};
    return made;
}

static void get_state(call *this, void **state) {
    message unused;
    writer to = {NULL, 0};
    entry *before;
    if (this->instance->stale) refresh(this->instance, &unused);
    if (!check_place(this, state, &before)) return;
    put_run(&to, &this->instance->run);
    saved *made = new_saved(to.size + CHECKSUM_SIZE);
    if (made != NULL) {
        to = (writer){made->bytes, 0};
        put_run(&to, &this->instance->run);
    }
    hand_over(this, made, state, before);
}

static void set_state(call *this, void *state) {
    message why, said;
    entry *locked = lock_state(this, state);
    if (locked == NULL) return;
    int restored = restore(this->instance, locked->thing, &why);
    unlock_entry(locked);
    if (restored) {
        this->instance->in_error = 0;
    } else {
        compose(&said, "state refused: %s", why.text);
        fail(this, &said);
    }
}

static void size_of_state(call *this, void *state, size_t *size) {
    if (!check(this, wrong_place(size))) return;
    entry *locked = lock_state(this, state);
    if (locked == NULL) return;
    *size = ((const saved *)locked->thing)->size;
    unlock_entry(locked);
}

static void serialise_state(call *this, void *state, unsigned char bytes[], size_t size) {
    if (!check(this, wrong_place(bytes))) return;
    entry *locked = lock_state(this, state);
    if (locked == NULL) return;
    saved *it = locked->thing;
    int fits = size == it->size;
    if (fits) {
        if (!it->sealed) seal(it);
        memcpy(bytes, it->bytes, size);
    }
    unlock_entry(locked);
    check(this, fits ? NULL : "the state has a different size");
}

static void deserialise_state(call *this, const unsigned char bytes[], size_t size, void **state) {
    entry *before;
    if (!check(this, wrong_bytes(bytes, size)) || !check_place(this, state, &before)) return;
    saved *made = new_saved(size);
    if (made != NULL) {
        memcpy(made->bytes, bytes, size);
        made->sealed = 1;
    }
    hand_over(this, made, state, before);
}
