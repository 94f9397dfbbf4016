/* The functions of FMI 2.0, and the file to compile: it includes all others. */
#include "platform.h"

#include "fmi2.h"

#if defined(FMI2_FUNCTION_PREFIX) && !defined(FMI2_OVERRIDE_FUNCTION_PREFIX)
#define NAMED(name) PREFIXED(FMI2_FUNCTION_PREFIX, name)
#else
#define NAMED(name) name
#endif

/* Value references are indices of the variables. */
enum { FIRST_REFERENCE = 0, HAS_TIME = 0 };

#include "component.c"

static const names version = {
    .types = {"Real", "Integer", "Boolean", "Enumeration"},
    .enumerations_are_integers = 1,
    .token = "GUID",
};

/* In FMI 2.0 a message is a format string, so each % is doubled. */
static void call_logger(const logger *host, string name, int status, string category, string text) {
    char format[2 * MOST_TEXT + 1];
    copy_doubled(format, text, '%');
    ((fmi2_logger)host->function)(host->environment, name, status, category, format);
}

FUNCTION(fmi2Reset, MASK_Reset, NULL, (void *c), renew(this.instance))
FUNCTION(fmi2SetupExperiment, MASK_SetupExperiment, NULL,
         (void *c, int has_tolerance, double tolerance, double start, int has_stop, double stop),
         set_experiment(&this, start, has_stop ? stop : INFINITY))
FUNCTION(fmi2DoStep, MASK_DoStep, NULL, (void *c, double time, double step, int no_set),
         take_step(&this, time, step))
FUNCTION(fmi2GetRealStatus, MASK_Get, wrong_place(v), (void *c, int kind, double *v), {
    if (kind == LAST_SUCCESSFUL_TIME) {
        *v = time_of(&this);
    } else {
        this.status = FMI_DISCARD;
        log_message(this.instance, FMI_DISCARD, "Invalid status inquiry for fmi2GetRealStatus");
    }
})

#define FORWARDED(name, allowed, wrong, parameters, arguments, ...)                              \
    FUNCTION(name, allowed, wrong, parameters, __VA_ARGS__)
#include "functions.h"
