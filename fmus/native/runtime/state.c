/* The state of an FMU: complete, exact, as bytes, and checked before it is restored.
 *
 * It is kept in memory as the bytes that it is serialised to:
 *
 *     MAGIC, identity, mode, start time, stop time, time,
 *     parameters in the order of their ports, inputs, Reals first,
 *     1 if there is a state, else 0; if there is one: the numbers of the state; for noise the words
 *     of the generator, the index of the next word, 1 if there is a next number, that number, and
 *     the last draw; for a sampled component the outputs, Reals first, and their freshness;
 *     fault;
 *     the CRC-32 of all that.
 *
 * All numbers are little-endian; Reals are IEEE 754 doubles, all others have four bytes. A text is
 * its length and its bytes.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char MAGIC[] = "FMU state 3";

/* Identifies states of this model and version. */
static const char IDENTITY[] = MODEL_NAME " " MODEL_GUID;

/* Bound of normal random numbers, which are made from 53 bits. */
static const double LARGEST_DRAW = 9.0;

enum { WORD_SIZE = 4, CHECKSUM_SIZE = WORD_SIZE };

typedef struct {
    size_t size;
    int sealed; /* true once the checksum is written, which is when it is needed */
    unsigned char bytes[1];
} saved;

/* Bytes to write or read, in the same order: each function takes a value, and returns it after
 * writing, or returns the value that was read, which is 0 after the end of the bytes. */
typedef struct {
    unsigned char *bytes; /* NULL: only count them */
    size_t place, size;   /* index of the next byte; number of readable bytes */
    int reads;
} tape;

static uint32_t pass_word(tape *it, uint32_t word) {
    size_t begin = it->place;
    it->place += WORD_SIZE;
    if (it->bytes == NULL) return word;
    if (it->reads && it->place > it->size) return 0;
    unsigned char *b = it->bytes + begin;
    if (it->reads) return b[0] | (uint32_t)b[1] << 8 | (uint32_t)b[2] << 16 | (uint32_t)b[3] << 24;
    for (int i = 0; i < WORD_SIZE; i++) b[i] = (unsigned char)(word >> 8 * i);
    return word;
}

static double pass_real(tape *it, double real) {
    uint64_t bits;
    memcpy(&bits, &real, sizeof bits);
    uint64_t lower = pass_word(it, (uint32_t)bits);
    bits = lower | (uint64_t)pass_word(it, (uint32_t)(bits >> 32)) << 32;
    memcpy(&real, &bits, sizeof real);
    return real;
}

/* Numbers of one type. */
static void pass_numbers(tape *it, fmi_type type, double numbers[], size_t n) {
    for (size_t i = 0; i < n; i++) {
        numbers[i] = type == REAL ? pass_real(it, numbers[i])
                                  : (int32_t)pass_word(it, (uint32_t)(int32_t)numbers[i]);
    }
}

/* Values of ports: Reals, and others. */
static void pass_values(tape *it, double values[], size_t reals, size_t n) {
    pass_numbers(it, REAL, values, reals);
    pass_numbers(it, INTEGER, values + reals, n - reals);
}

/* Writes a text, or returns true if it is read. */
static int pass_text(tape *it, string text) {
    size_t n = strlen(text), begin = it->place + WORD_SIZE;
    if (pass_word(it, (uint32_t)n) != n) return 0;
    it->place += n;
    if (it->reads) return it->place <= it->size && memcmp(it->bytes + begin, text, n) == 0;
    if (it->bytes != NULL) memcpy(it->bytes + begin, text, n);
    return 1;
}

static void pass_noise(tape *it, generator *noise, double draws[]) {
    for (int i = 0; i < GENERATOR_WORDS; i++) noise->words[i] = pass_word(it, noise->words[i]);
    noise->place = pass_word(it, noise->place);
    noise->has_next = (int)pass_word(it, (uint32_t)noise->has_next);
    noise->next = pass_real(it, noise->has_next ? noise->next : 0.0);
    pass_numbers(it, REAL, draws, MODEL_DRAWS);
}

static void pass_run(tape *tape, run *it) {
    moment *now = &it->moments[it->now];
    double *state = now->state.values;
    it->mode = (mode)pass_word(tape, it->mode);
    it->start_time = pass_real(tape, it->start_time);
    it->stop_time = pass_real(tape, it->stop_time);
    now->time = pass_real(tape, now->time);
    for (int i = 0; i < N_PORTS; i++) {
        if (ports[i].causality != PARAMETER) continue;
        double number = parameter(&it->parameters, &ports[i]);
        pass_numbers(tape, ports[i].type, &number, 1);
        put_parameter(&it->parameters, &ports[i], number);
    }
    pass_values(tape, it->inputs.values, REAL_INPUTS, MODEL_INPUTS);
    it->begun = (int)pass_word(tape, (uint32_t)it->begun);
    if (it->begun) {
        for (size_t i = 0; i < N_STATE_NUMBERS; state += state_numbers[i++].n) {
            pass_numbers(tape, state_numbers[i].type, state, state_numbers[i].n);
        }
        if (MODEL_DRAWS > 0) pass_noise(tape, &it->noise, now->draws);
        if (MODEL_SAMPLED) {
            pass_values(tape, it->outputs[it->shown].values, REAL_OUTPUTS, MODEL_OUTPUTS);
            now->outputs_are = (freshness)pass_word(tape, now->outputs_are);
        }
    }
    it->fault = (int)pass_word(tape, (uint32_t)it->fault);
}

/* Writes a run, and returns the size with the checksum; with NULL it only counts. */
static size_t write_run(unsigned char *bytes, run *it) {
    tape to = {.bytes = bytes};
    pass_text(&to, MAGIC);
    pass_text(&to, IDENTITY);
    pass_run(&to, it);
    return to.place + CHECKSUM_SIZE;
}

static uint32_t crc32(const unsigned char *bytes, size_t n) {
    /* Checksums of the half bytes 0 to 15. */
    static const uint32_t sums[] = {
        0x00000000, 0x1db71064, 0x3b6e20c8, 0x26d930ac, 0x76dc4190, 0x6b6b51f4,
        0x4db26158, 0x5005713c, 0xedb88320, 0xf00f9344, 0xd6d6a3e8, 0xcb61b38c,
        0x9b64c2b0, 0x86d3d2d4, 0xa00ae278, 0xbdbdf21c,
    };
    uint32_t sum = 0xffffffff;
    for (size_t i = 0; i < n; i++) {
        sum ^= bytes[i];
        sum = sum >> 4 ^ sums[sum & 15];
        sum = sum >> 4 ^ sums[sum & 15];
    }
    return ~sum;
}

static size_t content_size(const saved *state) {
    return state->size < CHECKSUM_SIZE ? 0 : state->size - CHECKSUM_SIZE;
}

static void seal(saved *state) {
    tape to = {.bytes = state->bytes, .place = content_size(state)};
    pass_word(&to, crc32(state->bytes, to.place));
    state->sealed = 1;
}

static int has_its_checksum(saved *state) {
    tape from = {state->bytes, content_size(state), state->size, 1};
    uint32_t sum = crc32(state->bytes, from.place);
    return pass_word(&from, 0) == sum;
}

/* Checks */

static int is_truth(double number) { return number == 0.0 || number == 1.0; }

/* Checks a value of a port; ranges of outputs do not matter, since no step depends on an output. */
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

/* Checks a number of the state. */
static int check_number(const numbers *of, double number, message *why) {
    if (of->type == REAL) return isfinite(number) || compose(why, "a value is not finite");
    if (of->type == BOOLEAN && !is_truth(number)) {
        return compose(why, "%.0f is not of type bool", number);
    }
    return check_member(of, number, why);
}

static int check_state(const double values[], message *why) {
    for (size_t i = 0; i < N_STATE_NUMBERS; values += state_numbers[i++].n) {
        for (size_t k = 0; k < state_numbers[i].n; k++) {
            if (!check_number(&state_numbers[i], values[k], why)) return 0;
        }
    }
    return 1;
}

static int can_be_drawn(double number) { return fabs(number) <= LARGEST_DRAW; }

static int check_noise(const generator *noise, const double draws[], message *why) {
    if (noise->place > GENERATOR_WORDS || !is_truth(noise->has_next)) {
        return compose(why, "its noise generator has an invalid state");
    }
    int good = can_be_drawn(noise->next);
    for (int i = 0; i < MODEL_DRAWS; i++) good &= can_be_drawn(draws[i]);
    return good || compose(why, "its noise is none that can be drawn");
}

/* Checks all values of a run that was read. */
static int check_run(const run *it, message *why) {
    const moment *now = &it->moments[it->now];
    const uint32_t mode = (uint32_t)it->mode;
    if (mode > TERMINATED) return compose(why, "%u is not a mode", mode);
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
            !check_value(&ports[i], parameter(&it->parameters, &ports[i]), why)) {
            return 0;
        }
    }
    if (!check_values(it->inputs.values, MODEL_INPUTS, input_references, why)) return 0;
    if (it->mode == INSTANTIATED && it->begun) {
        return compose(why, "it has a state before the initialisation");
    }
    if (it->mode >= STEPPING && it->mode < TERMINATED && !it->begun) {
        return compose(why, "it has steps without a state");
    }
    if (it->begun) {
        if (!check_state(now->state.values, why)) return 0;
        if (MODEL_DRAWS > 0 && !check_noise(&it->noise, now->draws, why)) return 0;
        if (MODEL_SAMPLED && (uint32_t)now->outputs_are > FRESH) {
            return compose(why, "its outputs are neither fresh nor not");
        }
        const double *outputs = it->outputs[it->shown].values;
        if (MODEL_SAMPLED && !check_values(outputs, MODEL_OUTPUTS, output_references, why)) {
            return 0;
        }
    }
    return is_truth(it->fault) || compose(why, "its fault is neither true nor false");
}

/* Checks that a run can have led to a state, whose numbers are finite. In model exchange the host
 * sets the state, so each can be reached. */
static int check_reachable(const run *it, int exchanges, message *why) {
    const model_parameters *parameters = &it->parameters.model;
    const state_values *state = &it->moments[it->now].state;
    Error error = {0};
    model_check(parameters, &error);
    if (exchanges) return !error.raised || compose(why, "%s", error.why.text);
    if (!error.raised && !is_bounded(state)) return compose(why, "it exceeds %g", LARGEST_STATE);
    model_check_state(parameters, &state->groups, &error);
    return !error.raised || compose(why, "%s", error.why.text);
}

/* Returns the largest size of a state; `it` is a new run. */
static size_t largest_size(run *it) {
    it->begun = 1;
    size_t size = write_run(NULL, it);
    it->begun = 0;
    return size;
}

/* Checks that a run is of the interface of an instance. */
static int check_interface(const run *it, int exchanges, message *why) {
    if (it->mode < STEPPING || it->mode >= TERMINATED || exchanges == (it->mode != STEPPING)) {
        return 1;
    }
    return compose(why, "it is of an instance for %s", exchanges ? "co-simulation" : "model exchange");
}

/* Reads a saved state into a new run, and checks it. */
static int take_saved(saved *state, run *it, int exchanges, message *why) {
    tape from = {state->bytes, 0, content_size(state), 1};
    if (!pass_text(&from, MAGIC)) return compose(why, "the bytes are not a state");
    if (state->size > largest_size(it)) return compose(why, "it has missing or unknown parts");
    if (state->sealed && !has_its_checksum(state)) {
        return compose(why, "the bytes were changed since they were written");
    }
    if (!pass_text(&from, IDENTITY)) return compose(why, "not a state of %s", IDENTITY);
    pass_run(&from, it);
    if (!check_run(it, why) || !check_interface(it, exchanges, why)) return 0;
    if (from.place != from.size || !is_truth(it->begun)) {
        return compose(why, "it has missing or unknown parts");
    }
    if (it->begun && !MODEL_SAMPLED) it->moments[it->now].outputs_are = OUTDATED;
    return !it->begun || check_reachable(it, exchanges, why);
}

static int restore(instance *it, saved *state, message *why) {
    run *wanted = malloc(sizeof *wanted);
    if (wanted == NULL) return compose(why, "out of memory");
    renew_run(wanted);
    int good = take_saved(state, wanted, it->exchanges, why) &&
               (!wanted->begun || adopt(it, &wanted->parameters, why));
    if (good) {
        it->run = *wanted;
        it->stale = 0;
        /* Before the first step the state follows from parameters and inputs, and is recomputed. */
        note_change(it, 0, 0);
    }
    free(wanted);
    return good;
}

/* Functions for the host's states */

static void free_saved(instance *it, void *saved) {
    (void)it;
    free(saved);
}

/* Allocates a state of a size; NULL if there is no memory. */
static saved *new_saved(size_t size) {
    saved *made = malloc(sizeof *made + size);
    if (made != NULL) *made = (saved){.size = size};
    return made;
}

static void *make_saved(call *this) {
    message unused;
    if (this->instance->stale) refresh(this->instance, &unused);
    saved *made = new_saved(write_run(NULL, &this->instance->run));
    if (made != NULL) write_run(made->bytes, &this->instance->run);
    return made;
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

static size_t size_of_saved(call *this, void *state) {
    (void)this;
    return ((const saved *)state)->size;
}

static void write_saved(call *this, void *state, void *bytes, size_t size) {
    saved *it = state;
    (void)this;
    if (!it->sealed) seal(it);
    memcpy(bytes, it->bytes, size);
}

static void *read_saved(call *this, const void *bytes, size_t size) {
    saved *made = new_saved(size);
    (void)this;
    if (made != NULL) {
        memcpy(made->bytes, bytes, size);
        made->sealed = 1;
    }
    return made;
}
