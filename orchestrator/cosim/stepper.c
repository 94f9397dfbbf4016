/* The compiled loop of a run: loop.py calls it, and has the same loop in Python.
 *
 * It makes steps through the FMUs' own functions, and a row for each, until Python has to act: the
 * block of rows is full, hooks are due, or a step has failed.
 */
#ifdef _WIN32
#include <windows.h>
#define EXPORTED __declspec(dllexport)
#else
#define _POSIX_C_SOURCE 199309L
#include <time.h>
#define EXPORTED __attribute__((visibility("default")))
#endif
#ifndef __x86_64__
#include <fenv.h>
#endif
#include <float.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* The worst of FMI's statuses that is not a failure, and two that are. */
enum { FMI_WARNING = 1, FMI_DISCARD = 2, FMI_ERROR = 3 };

/* If this many steps take no measurable time, the clock is read only after a few of them. */
enum { MANY = 1024, FEW = 8 };

/* Partial sums that processors compute in parallel. */
enum { LANES = 4 };

typedef unsigned reference;

/* FMI's function that moves values of one type, to an FMU or from it. */
typedef union {
    int (*fmi2)(void *component, const reference[], size_t n, void *values);
    int (*fmi3)(void *component, const reference[], size_t n, void *values, size_t n_values);
} mover;

/* Values of one type that are neighbours in the row. */
typedef struct {
    mover call;
    int (*python)(void); /* used for values that the row holds as stand-ins */
    const reference *references;
    size_t n_references, n;
    double *row;  /* address of the first one in the row */
    void *values; /* in the type of the FMU; doubles are in the row itself */
    enum {
        IN_PLACE, OF_FLOAT32, OF_INT8, OF_UINT8, OF_INT16, OF_UINT16, OF_INT32, OF_UINT32,
        OF_INT64, OF_UINT64, BY_PYTHON
    } kind;
    int is_counted; /* true if the function takes the number of values, as in FMI 3.0 */
} move;

/* Results of doStep of FMI 3.0. */
typedef struct {
    bool event, terminate, early;
    double last;
} step_result;

typedef struct {
    void *component;
    union {
        int (*fmi2)(void *component, double t, double h, int no_rollback);
        int (*fmi3)(void *component, double t, double h, bool no_rollback, bool *event,
                    bool *terminate, bool *early, double *last);
    } do_step;
    step_result *result; /* NULL for FMI 2.0 */
    const move *inputs, *outputs;
    size_t n_inputs, n_outputs;
} member;

/* Values that a connection maps to others; unlisted values stay as they are. */
typedef struct {
    size_t connection, n;
    const double *from, *to;
} mapping;

/* Inputs to gather, and the components to step then. */
typedef struct {
    const size_t *targets, *sources;
    const double *factors, *offsets;
    const mapping *mappings;
    const member *members;
    size_t n_connections, n_mappings, n_members;
    size_t every; /* number of communication steps in one step of its components */
    int at_end;   /* true for the last of these steps, false for the first */
} stage;

typedef struct {
    const stage *stages;
    double *values; /* the row of all values: first the shown ones, then the hidden ones */
    size_t n_stages;
    size_t shown_after; /* number of stages before the row is shown; if it is all of them, the row
                           shows the end of the step */
    size_t n_shown;
    double start_time, step, stop_time;
    size_t full_steps, steps; /* if `steps` is greater, the last step is shorter */
} run;

/* Rows, each with the time in front; Python reads their number between calls. */
typedef struct {
    double *rows;
    size_t most, n;
} block;

/* The first call with a status worse than a warning. */
typedef struct {
    size_t stage, member;
    enum { SET_INPUTS, DO_STEP, GET_OUTPUTS } call;
    int status;
} failure;

/* Restore the default floating-point mode after calls of an FMU: see fmi/surroundings.py. Return
 * true if the mode was another one; where that cannot be told, return false. */
#ifdef __x86_64__
enum { CAN_TELL = 1 };
static inline int put_back(void) {
    const unsigned flags = 0x3f, sse = 0x1f80;
    const unsigned short x87 = 0x37f;
    unsigned present;
    __asm__ volatile("stmxcsr %0" : "=m"(present));
    if ((present & ~flags) != sse) {
        __asm__ volatile("ldmxcsr %0\n\tfldcw %1" : : "m"(sse), "m"(x87) : "memory");
        return 1;
    }
    return 0;
}
#else
enum { CAN_TELL = 0 };
static inline int put_back(void) {
    fesetenv(FE_DFL_ENV);
    return 0;
}
#endif

/* Reasons to return. */
enum { DUE, FAILED, NOT_FINITE };

/* Return a monotonic time in seconds. */
static double now(void) {
#ifdef _WIN32
    return 1e-3 * (double)GetTickCount64();
#else
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
#endif
}

static int call(const move *it, void *component) {
    if (it->is_counted) {
        return it->call.fmi3(component, it->references, it->n_references, it->values, it->n);
    }
    return it->call.fmi2(component, it->references, it->n_references, it->values);
}

/* All integers below are doubles, and stand for themselves in the row. */
static const double EXACT = 9007199254740992.0;

/* The check of the row reports values that do not fit a type. */
#define SET(kind, type, fits, otherwise)                                                         \
    case kind:                                                                                   \
        for (i = 0; i < it->n; i++) {                                                            \
            const double value = it->row[i];                                                     \
            if (!(fits)) return otherwise;                                                       \
            ((type *)it->values)[i] = (type)value;                                               \
        }                                                                                        \
        break;
#define SET_INTEGERS(kind, type, least, most)                                                    \
    SET(kind, type, value >= least && value <= most && value == (double)(type)value, FMI_ERROR)
#define SET_WIDE(kind, type, least)                                                              \
    SET(kind, type, value >= least && value < EXACT && value == (double)(type)value, it->python())

static int set_converted(const move *it, void *component) {
    size_t i;
    switch (it->kind) {
        case IN_PLACE: break;
        case BY_PYTHON: return it->python();
        SET(OF_FLOAT32, float, value >= -FLT_MAX && value <= FLT_MAX, FMI_ERROR)
        SET_INTEGERS(OF_INT8, int8_t, INT8_MIN, INT8_MAX)
        SET_INTEGERS(OF_UINT8, uint8_t, 0, UINT8_MAX)
        SET_INTEGERS(OF_INT16, int16_t, INT16_MIN, INT16_MAX)
        SET_INTEGERS(OF_UINT16, uint16_t, 0, UINT16_MAX)
        SET_INTEGERS(OF_INT32, int32_t, INT32_MIN, INT32_MAX)
        SET_INTEGERS(OF_UINT32, uint32_t, 0, UINT32_MAX)
        SET_WIDE(OF_INT64, int64_t, -EXACT)
        SET_WIDE(OF_UINT64, uint64_t, 0)
    }
    return call(it, component);
}

#define GET(kind, type)                                                                          \
    case kind:                                                                                   \
        for (i = 0; i < it->n; i++) it->row[i] = ((const type *)it->values)[i];                  \
        break;

#define GET_WIDE(kind, type)                                                                     \
    case kind:                                                                                   \
        for (i = 0; i < it->n; i++) {                                                            \
            const double value = (double)((const type *)it->values)[i];                          \
            if (value <= -EXACT || value >= EXACT) return it->python();                          \
            it->row[i] = value;                                                                  \
        }                                                                                        \
        break;

static int get_converted(const move *it, void *component) {
    size_t i;
    const int status = it->kind == BY_PYTHON ? it->python() : call(it, component);
    switch (it->kind) {
        case IN_PLACE:
        case BY_PYTHON: break;
        GET(OF_FLOAT32, float)
        GET(OF_INT8, int8_t)
        GET(OF_UINT8, uint8_t)
        GET(OF_INT16, int16_t)
        GET(OF_UINT16, uint16_t)
        GET(OF_INT32, int32_t)
        GET(OF_UINT32, uint32_t)
        GET_WIDE(OF_INT64, int64_t)
        GET_WIDE(OF_UINT64, uint64_t)
    }
    return status;
}

/* The most frequent case is tested first. */
static int set(const move *it, void *component) {
    return it->kind == IN_PLACE ? call(it, component) : set_converted(it, component);
}

static int get(const move *it, void *component) {
    return it->kind == IN_PLACE ? call(it, component) : get_converted(it, component);
}

/* Return true for a status that is worse than a warning, or not one of FMI's. */
static int is_bad(int status) { return (unsigned)status > FMI_WARNING; }

/* Read the outputs of a stage, restoring the mode after each component if `careful`; return true if
 * one failed. */
static int outputs_failed(const stage *this, int careful, failure *why) {
    size_t i, j;
    for (i = 0; i < this->n_members; i++) {
        const member *it = &this->members[i];
        why->member = i;
        for (j = 0; j < it->n_outputs; j++) {
            if (is_bad(why->status = get(&it->outputs[j], it->component))) return 1;
        }
        if (careful) put_back();
    }
    return 0;
}

/* Step a component; values only pass through one without this function. */
static int do_step(const member *it, double t, double h) {
    step_result *result = it->result;
    int status;
    if (it->do_step.fmi2 == NULL) return 0;
    if (result == NULL) return it->do_step.fmi2(it->component, t, h, 1);
    status = it->do_step.fmi3(it->component, t, h, true, &result->event, &result->terminate,
                              &result->early, &result->last);
    /* Python interprets it. */
    return !is_bad(status) && (result->terminate || result->early) ? FMI_DISCARD : status;
}

/* Step the components of a stage; return true if one of them failed. */
static int stage_failed(const stage *this, double t, double h, failure *why) {
    size_t i, j;
    for (i = 0; i < this->n_members; i++) {
        const member *it = &this->members[i];
        why->member = i;
        why->call = SET_INPUTS;
        for (j = 0; j < it->n_inputs; j++) {
            if (is_bad(why->status = set(&it->inputs[j], it->component))) return 1;
        }
        why->call = DO_STEP;
        if (is_bad(why->status = do_step(it, t, h))) return 1;
        if (this->n_members > 1) put_back();
    }
    why->call = GET_OUTPUTS;
    if (outputs_failed(this, !CAN_TELL, why)) return 1;
    /* Outputs that were read in a changed mode are read again. */
    return put_back() && this->n_members > 1 && outputs_failed(this, 1, why);
}

static double mapped(const mapping *this, double value) {
    size_t i;
    for (i = 0; i < this->n; i++) {
        if (this->from[i] == value) return this->to[i];
    }
    return value;
}

/* No target is a source of the same stage, so that mapped values can be moved a second time. */
static void gather(const stage *this, double values[]) {
    const size_t *to = this->targets, *from = this->sources;
    size_t i, j;
    for (i = 0; i < this->n_connections; i++) {
        values[to[i]] = this->factors[i] * values[from[i]] + this->offsets[i];
    }
    for (j = 0; j < this->n_mappings; j++) {
        i = this->mappings[j].connection;
        values[to[i]] =
            this->factors[i] * mapped(&this->mappings[j], values[from[i]]) + this->offsets[i];
    }
}

/* Return true in the steps in which the components of a stage are stepped or shown. */
static int is_due(const stage *this, size_t k, size_t steps) {
    if (this->at_end) return (k + 1) % this->every == 0 || k + 1 == steps;
    return k % this->every == 0;
}

static double time_after(const run *this, size_t k) {
    return k <= this->full_steps ? this->start_time + (double)k * this->step : this->stop_time;
}

/* Return the length of the n steps after the k-th, or of as many as are left. */
static double length_of(const run *this, size_t k, size_t n) {
    if (k + n <= this->full_steps) return (double)n * this->step;
    if (this->steps > this->full_steps) return this->stop_time - time_after(this, k);
    return (double)(this->full_steps - k) * this->step;
}

/* Make some stages of the step after the k-th; return true if a component failed. */
static int stages_failed(const run *this, size_t first, size_t end, size_t k, failure *why) {
    const double t = time_after(this, k), h = length_of(this, k, 1);
    for (why->stage = first; why->stage < end; why->stage++) {
        const stage *it = &this->stages[why->stage];
        const int slow = it->every > 1;
        if (slow && !is_due(it, k, this->steps)) continue;
        gather(it, this->values);
        if (stage_failed(it, t, slow ? length_of(this, k, it->every) : h, why)) return 1;
    }
    return 0;
}

/* Zero times a finite number is zero, otherwise NaN. */
static int all_finite(const double values[], size_t n) {
    double sums[LANES] = {0.0}, sum = 0.0;
    size_t i, j;
    for (i = 0; i + LANES <= n; i += LANES) {
        for (j = 0; j < LANES; j++) sums[j] += 0.0 * values[i + j];
    }
    for (; i < n; i++) sum += 0.0 * values[i];
    for (j = 0; j < LANES; j++) sum += sums[j];
    return sum == 0.0;
}

/* Make steps until their number is `until`, and count them. */
EXPORTED int advance(const run *this, size_t *made, size_t until, double patience, block *rows,
                     failure *why) {
    const int shown_at_end = this->shown_after == this->n_stages;
    const double due = now() + patience;
    double last = due - patience;
    int unasked = 1; /* steps until the clock is read again, which takes as long as an FMI call */
    while (*made < until && rows->n < rows->most) {
        double *row = rows->rows + rows->n * (1 + this->n_shown);
        if (stages_failed(this, 0, this->shown_after, *made, why)) {
            put_back();
            return FAILED;
        }
        if (!all_finite(this->values, this->n_shown)) return NOT_FINITE;
        row[0] = time_after(this, *made + shown_at_end);
        memcpy(row + 1, this->values, this->n_shown * sizeof *row);
        rows->n++;
        if (stages_failed(this, this->shown_after, this->n_stages, *made, why)) {
            put_back();
            return FAILED;
        }
        ++*made;
        if (--unasked == 0) {
            const double present = now();
            if (present >= due) break;
            unasked = present - last < patience / MANY ? FEW : 1;
            last = present;
        }
    }
    return DUE;
}
