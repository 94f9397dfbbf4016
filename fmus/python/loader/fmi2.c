/* The functions of FMI 2.0: valid calls are forwarded to PythonFMU. */
#define _GNU_SOURCE
#include <stdlib.h>
#include <string.h>

#include "loader.h"

#include "../../native/runtime/host.c"
#include "../../native/runtime/handles.c"
#include "../../native/runtime/calls.c"

#include "python.c"
#include "preflight.c"
#include "location.c"
#include "guard.c"

/* What PythonFMU answers to one of its functions. */
#define TO_PYTHONFMU(call, name, parameters, arguments)                                          \
    do {                                                                                         \
        static int(*forward) parameters;                                                         \
        if (forward == NULL) forward = (int(*) parameters)pythonfmu_function(#name);             \
        (call).status = forward == NULL ? FMI_FATAL : forward arguments;                         \
    } while (0)

/* A function that is forwarded as it is if nothing is wrong with its arguments. */
#define FORWARD(name, allowed, wrong, parameters, arguments)                                     \
    EXPORT int name parameters {                                                                 \
        call this = enter(c, #name, allowed);                                                    \
        if (GOES_ON(this, wrong)) {                                                              \
            c = this.instance->slave;                                                            \
            TO_PYTHONFMU(this, name, parameters, arguments);                                     \
            take_answer(&this, !((allowed) & WHEN(AFTER_ERROR)));                                \
        }                                                                                        \
        return end(&this);                                                                       \
    }

EXPORT string fmi2GetTypesPlatform(void) { return "default"; }

EXPORT string fmi2GetVersion(void) { return "2.0"; }

/* Making and freeing */

static void free_slave(component slave) {
    ((void (*)(component))pythonfmu_function("fmi2FreeInstance"))(slave);
}

static component new_slave(instance *it, string guid, string path, int visible, message *why) {
    typedef component (*instantiate)(string, int, string, string, const callbacks *, int, int);
    instantiate forward = (instantiate)pythonfmu_function("fmi2Instantiate");
    component slave = forward(it->host.name, CO_SIMULATION, guid, path, &it->heard, visible, 1);
    /* PythonFMU's watch over an interpreter that it has not started: it would free it twice when
     * the process ends. */
    ((void (*)(void))pythonfmu_function("finalizePythonInterpreter"))();
    if (take_exception(why) && slave != NULL) {
        free_slave(slave);
        slave = NULL;
    }
    if (slave == NULL) forget(path);
    return slave;
}

static component new_component(instance *it, string guid, string path, int visible, message *why) {
    component handle = NULL;
    if (!load(why)) return NULL;
    int lock = py.PyGILState_Ensure();
    begin_making();
    if (preflight(path, guid, why)) it->slave = new_slave(it, guid, path, visible, why);
    end_making();
    if (it->slave != NULL) {
        handle = new_handle(INSTANCE, it, NULL);
        if (handle == NULL) free_slave(it->slave);
    }
    py.PyGILState_Release(lock);
    return handle;
}

EXPORT component fmi2Instantiate(string name, int type, string guid, string location,
                                 const callbacks *functions, int visible, int logging) {
    string wrong = type != CO_SIMULATION ? "this FMU is for co-simulation only"
                   : location == NULL    ? "there is no resource location"
                                         : NULL;
    char *path = NULL;
    message why;
    instance *it = new_instance(name, functions, logging);
    component handle = NULL;
    if (it == NULL) return NULL;
    compose(&why, "the slave cannot be created");
    if (check_instance(wrong, name, "GUID", guid, &why) && plain_path(location, &path, &why)) {
        handle = new_component(it, guid, path, visible, &why);
    }
    free(path);
    if (handle == NULL && !it->has_logged_error) log_error(it, "fmi2Instantiate", why.text);
    log_queue(it);
    if (handle == NULL) release_instance(it);
    return handle;
}

static void free_saved(instance *it, void *saved) {
    typedef int (*free_state)(component, void **);
    if (!it->is_lost) ((free_state)pythonfmu_function("fmi2FreeFMUstate"))(it->slave, &saved);
}

EXPORT void fmi2FreeInstance(component c) {
    if (c == NULL) return;
    call this = enter(c, "fmi2FreeInstance", MASK_FreeInstance);
    if (this.instance == NULL) return;
    free_handles(&this);
    if (!this.instance->is_lost) free_slave(this.instance->slave);
    leave(&this);
    release_instance(this.instance);
}

EXPORT int fmi2Reset(component c) {
    call this = enter(c, "fmi2Reset", MASK_Reset);
    if (GOES_ON(this, NULL)) {
        TO_PYTHONFMU(this, fmi2Reset, (component), (this.instance->slave));
        if (this.status == FMI_OK) {
            this.instance->in_error = 0;
            this.instance->last_successful_time = 0.0;
        }
    }
    return end(&this);
}

/* Messages are chosen here: PythonFMU would keep errors back, too. */
EXPORT int fmi2SetDebugLogging(component c, int on, size_t n, const string names[]) {
    call this = enter(c, "fmi2SetDebugLogging", MASK_SetDebugLogging);
    if (GOES_ON(this, wrong_texts(n, names)) &&
        !choose_categories(&this.instance->host, on, n, names)) {
        check(&this, "out of memory");
    }
    return end(&this);
}

/* Modes and steps */

static void come_to(instance *it, double time) {
    it->last_successful_time = isnan(it->time_told) ? time : it->time_told;
}

/* A function that is forwarded, and after which steps have come to a time. */
#define FORWARD_TO(time_after, name, allowed, parameters, arguments)                             \
    EXPORT int name parameters {                                                                 \
        call this = enter(c, #name, allowed);                                                    \
        if (GOES_ON(this, NULL)) {                                                               \
            c = this.instance->slave;                                                            \
            TO_PYTHONFMU(this, name, parameters, arguments);                                     \
            take_answer(&this, 1);                                                               \
            if (this.status == FMI_OK) come_to(this.instance, time_after);                       \
        }                                                                                        \
        return end(&this);                                                                       \
    }

FORWARD_TO(start, fmi2SetupExperiment, MASK_SetupExperiment,
           (component c, int has_tolerance, double tolerance, double start, int has_stop,
            double stop),
           (c, has_tolerance, tolerance, start, has_stop, stop))
FORWARD(fmi2EnterInitializationMode, MASK_EnterInitializationMode, NULL, (component c), (c))
FORWARD(fmi2ExitInitializationMode, MASK_ExitInitializationMode, NULL, (component c), (c))
FORWARD(fmi2Terminate, MASK_Terminate, NULL, (component c), (c))
FORWARD_TO(time + step, fmi2DoStep, MASK_DoStep,
           (component c, double time, double step, int no_set), (c, time, step, no_set))
FORWARD(fmi2CancelStep, MASK_NotSupported, NULL, (component c), (c))

/* Values */

#define GET(name, type)                                                                          \
    FORWARD(name, MASK_Get, wrong_values(n, r, v),                                               \
            (component c, const reference r[], size_t n, type v[]), (c, r, n, v))
#define SET(name, type, wrong)                                                                   \
    FORWARD(name, MASK_Set, wrong, (component c, const reference r[], size_t n, type v[]),       \
            (c, r, n, v))

GET(fmi2GetReal, double)
GET(fmi2GetInteger, int)
GET(fmi2GetBoolean, int)
GET(fmi2GetString, string)
SET(fmi2SetReal, const double, wrong_values(n, r, v))
SET(fmi2SetInteger, const int, wrong_values(n, r, v))
SET(fmi2SetBoolean, const int, wrong_values(n, r, v))
SET(fmi2SetString, const string, wrong_strings(n, r, v))

/* States */

EXPORT int fmi2GetFMUstate(component c, void **state) {
    call this = enter(c, "fmi2GetFMUstate", MASK_FMUstate);
    entry *before;
    if (GOES_ON(this, NULL) && check_place(&this, state, &before)) {
        void *made = NULL;
        TO_PYTHONFMU(this, fmi2GetFMUstate, (component, void **), (this.instance->slave, &made));
        hand_over(&this, made, state, before);
    }
    return end(&this);
}

EXPORT int fmi2SetFMUstate(component c, void *state) {
    call this = enter(c, "fmi2SetFMUstate", MASK_FMUstate);
    entry *saved;
    if (GOES_ON(this, NULL) && (saved = lock_state(&this, state)) != NULL) {
        TO_PYTHONFMU(this, fmi2SetFMUstate, (component, void *),
                     (this.instance->slave, saved->thing));
        unlock_entry(saved);
        take_answer(&this, 1);
        if (this.status == FMI_OK) {
            this.instance->in_error = 0;
            come_to(this.instance, this.instance->last_successful_time);
        }
    }
    return end(&this);
}

EXPORT int fmi2FreeFMUstate(component c, void **state) {
    call this = enter(c, "fmi2FreeFMUstate", MASK_FMUstate);
    if (GOES_ON(this, NULL)) free_state(&this, state);
    return end(&this);
}

static size_t size_of_state(call *this, void *saved) {
    size_t size = 0;
    TO_PYTHONFMU(*this, fmi2SerializedFMUstateSize, (component, void *, size_t *),
                 (this->instance->slave, saved, &size));
    return size;
}

EXPORT int fmi2SerializedFMUstateSize(component c, void *state, size_t *size) {
    call this = enter(c, "fmi2SerializedFMUstateSize", MASK_FMUstate);
    entry *saved;
    if (GOES_ON(this, wrong_place(size)) && (saved = lock_state(&this, state)) != NULL) {
        *size = size_of_state(&this, saved->thing);
        unlock_entry(saved);
    }
    return end(&this);
}

/* PythonFMU copies as many bytes as it is told, however many there are. */
EXPORT int fmi2SerializeFMUstate(component c, void *state, char bytes[], size_t size) {
    call this = enter(c, "fmi2SerializeFMUstate", MASK_FMUstate);
    entry *saved;
    if (GOES_ON(this, wrong_place(bytes)) && (saved = lock_state(&this, state)) != NULL) {
        size_t needed = size_of_state(&this, saved->thing);
        if (GOES_ON(this, size != needed ? "the state has a different size" : NULL)) {
            TO_PYTHONFMU(this, fmi2SerializeFMUstate, (component, void *, char *, size_t),
                         (this.instance->slave, saved->thing, bytes, size));
        }
        unlock_entry(saved);
    }
    return end(&this);
}

EXPORT int fmi2DeSerializeFMUstate(component c, const char bytes[], size_t size, void **state) {
    call this = enter(c, "fmi2DeSerializeFMUstate", MASK_FMUstate);
    entry *before;
    if (GOES_ON(this, wrong_bytes(bytes, size)) && check_place(&this, state, &before)) {
        void *made = NULL;
        TO_PYTHONFMU(this, fmi2DeSerializeFMUstate, (component, const char *, size_t, void **),
                     (this.instance->slave, bytes, size, &made));
        hand_over(&this, made, state, before);
    }
    return end(&this);
}

/* What PythonFMU has no answer to, or hardly one */

FORWARD(fmi2GetDirectionalDerivative, MASK_NotSupported, NULL,
        (component c, const reference u[], size_t nu, const reference k[], size_t nk,
         const double dk[], double du[]),
        (c, u, nu, k, nk, dk, du))
FORWARD(fmi2SetRealInputDerivatives, MASK_NotSupported, NULL,
        (component c, const reference r[], size_t n, const int order[], const double v[]),
        (c, r, n, order, v))
FORWARD(fmi2GetRealOutputDerivatives, MASK_NotSupported, NULL,
        (component c, const reference r[], size_t n, const int order[], double v[]),
        (c, r, n, order, v))

#define STATUS(name, type)                                                                       \
    FORWARD(name, MASK_Get, wrong_place(v), (component c, int kind, type *v),                    \
            (c, kind, v))

STATUS(fmi2GetStatus, int)
STATUS(fmi2GetIntegerStatus, int)
STATUS(fmi2GetStringStatus, string)

/* PythonFMU's time is also that of a step that was refused, and of the run before a reset. */
EXPORT int fmi2GetRealStatus(component c, int kind, double *v) {
    call this = enter(c, "fmi2GetRealStatus", MASK_Get);
    if (GOES_ON(this, wrong_place(v))) {
        if (kind == LAST_SUCCESSFUL_TIME) {
            *v = this.instance->last_successful_time;
        } else {
            TO_PYTHONFMU(this, fmi2GetRealStatus, (component, int, double *),
                         (this.instance->slave, kind, v));
        }
    }
    return end(&this);
}

/* No answer: PythonFMU's own is "true" after each refused step, and hosts would end the run as a
 * success; with "false" FMPy would repeat the step without end. */
EXPORT int fmi2GetBooleanStatus(component c, int kind, int *v) {
    call this = enter(c, "fmi2GetBooleanStatus", MASK_Get);
    (void)kind;
    if (GOES_ON(this, wrong_place(v))) {
        *v = 0;
        this.status = FMI_DISCARD;
    }
    return end(&this);
}

static int not_supported(component c, string function) {
    call this = enter(c, function, MASK_NotSupported);
    if (GOES_ON(this, NULL)) refuse_unsupported(&this, FMI_ERROR);
    return end(&this);
}

#pragma GCC diagnostic ignored "-Wunused-parameter"
#define NOT_SUPPORTED(name, parameters)                                                          \
    EXPORT int name parameters { return not_supported(c, #name); }

MODEL_EXCHANGE_FUNCTIONS(NOT_SUPPORTED)
