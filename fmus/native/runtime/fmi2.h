/* Types of FMI 2.0, for both kinds of component. */
#ifndef FMI2_H
#define FMI2_H

#include "host.h"

enum { MODEL_EXCHANGE, CO_SIMULATION };

/* A kind of fmi2GetRealStatus. */
enum { LAST_SUCCESSFUL_TIME = 2 };

typedef void (*fmi2_logger)(void *, string, int, string, string, ...);

/* fmi2CallbackFunctions; only the logger is used. */
typedef struct {
    fmi2_logger logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} callbacks;

/* fmi2EventInfo. */
typedef struct {
    int new_discrete_states_needed, terminate_simulation, nominals_changed, values_changed;
    int next_event_time_defined;
    double next_event_time;
} event_info;

static logger logger_of(const callbacks *functions) {
    if (functions == NULL) return (logger){NULL, NULL};
    return (logger){(void (*)(void))functions->logger, functions->environment};
}

#endif
