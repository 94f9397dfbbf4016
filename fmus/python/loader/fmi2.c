/* The functions of FMI 2.0: valid calls are forwarded to PythonFMU. */
#define _GNU_SOURCE
#define NAMED(name) name
#include <stdlib.h>
#include <string.h>

#include "loader.h"

#include "../../native/runtime/host.c"
#include "../../native/runtime/handles.c"
#include "../../native/runtime/calls.c"

#include "python.c"
#include "guard.c"

#pragma GCC diagnostic ignored "-Wunused-parameter"

/* Calls a function of PythonFMU, and takes the statuses of PythonFMU and of the slave. */
#define FORWARD(call, name, parameters, arguments)                                               \
    do {                                                                                         \
        static int(*forward) parameters;                                                         \
        if (forward == NULL) forward = (int(*) parameters)pythonfmu_function(#name);             \
        (call)->status = forward == NULL ? FMI_FATAL : forward arguments;                        \
        take_answer(call);                                                                       \
    } while (0)

/* Sets the last successful time after a call, unless the slave has logged another. */
static void come_to(call *this, double time) {
    instance *it = this->instance;
    if (this->status != FMI_OK) return;
    it->last_successful_time = isnan(it->time_told) ? time : it->time_told;
}

/* Leaves the error state after a successful call. */
static void recover(call *this, double time) {
    if (this->status == FMI_OK) this->instance->in_error = 0;
    come_to(this, time);
}

/* PythonFMU has no model exchange. */
enum { EXCHANGES = 0 };

static void *for_exchange(void *handle) { return handle; }

#define EXCHANGED(name, allowed, wrong, parameters, ...)                                         \
    FUNCTION(name, MASK_NotSupported, NULL, parameters, refuse_unsupported(&this, FMI_ERROR))

#define FORWARDED(name, allowed, wrong, parameters, arguments, ...)                              \
    FUNCTION(name, allowed, wrong, parameters, c = this.instance->slave;                         \
             FORWARD(&this, name, parameters, arguments))

FUNCTION(fmi2Reset, MASK_Reset, NULL, (void *c),
         FORWARD(&this, fmi2Reset, (void *), (this.instance->slave));
         recover(&this, 0.0))
FUNCTION(fmi2SetupExperiment, MASK_SetupExperiment, NULL,
         (void *c, int has_tolerance, double tolerance, double start, int has_stop, double stop),
         FORWARD(&this, fmi2SetupExperiment, (void *, int, double, double, int, double),
                 (this.instance->slave, has_tolerance, tolerance, start, has_stop, stop));
         come_to(&this, start))
FUNCTION(fmi2DoStep, MASK_DoStep, NULL, (void *c, double time, double step, int no_set),
         FORWARD(&this, fmi2DoStep, (void *, double, double, int),
                 (this.instance->slave, time, step, no_set));
         come_to(&this, time + step))

/* PythonFMU also returns times of refused steps, and of the run before a reset. */
FUNCTION(fmi2GetRealStatus, MASK_Get, wrong_place(v), (void *c, int kind, double *v), {
    if (kind == LAST_SUCCESSFUL_TIME) {
        *v = this.instance->last_successful_time;
    } else {
        FORWARD(&this, fmi2GetRealStatus, (void *, int, double *),
                (this.instance->slave, kind, v));
    }
})

static void *make_saved(call *this) {
    void *made = NULL;
    FORWARD(this, fmi2GetFMUstate, (void *, void **), (this->instance->slave, &made));
    return made;
}

static void *read_saved(call *this, const void *bytes, size_t size) {
    void *made = NULL;
    FORWARD(this, fmi2DeSerializeFMUstate, (void *, const char *, size_t, void **),
            (this->instance->slave, bytes, size, &made));
    return made;
}

static size_t size_of_saved(call *this, void *saved) {
    size_t size = 0;
    FORWARD(this, fmi2SerializedFMUstateSize, (void *, void *, size_t *),
            (this->instance->slave, saved, &size));
    return size;
}

/* PythonFMU copies `size` bytes without checking how many there are. */
static void write_saved(call *this, void *saved, void *bytes, size_t size) {
    FORWARD(this, fmi2SerializeFMUstate, (void *, void *, char *, size_t),
            (this->instance->slave, saved, bytes, size));
}

static void free_saved(instance *it, void *saved) {
    typedef int (*free_state)(void *, void **);
    if (!it->is_lost) ((free_state)pythonfmu_function("fmi2FreeFMUstate"))(it->slave, &saved);
}

static void set_state(call *this, void *state) {
    entry *saved = lock_state(this, state);
    if (saved == NULL) return;
    FORWARD(this, fmi2SetFMUstate, (void *, void *), (this->instance->slave, saved->thing));
    unlock_entry(saved);
    if (this->instance->answer >= FMI_ERROR) this->instance->in_error = 1;
    recover(this, this->instance->last_successful_time);
}

#include "../../native/runtime/functions.h"
