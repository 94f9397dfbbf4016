/* What FMI 2.0 is made of, for both runtimes. */
#ifndef FMI2_H
#define FMI2_H

#include "host.h"

enum { CO_SIMULATION = 1 };

/* A kind of fmi2GetRealStatus. */
enum { LAST_SUCCESSFUL_TIME = 2 };

typedef void (*fmi2_logger)(void *, string, int, string, string, ...);

/* fmi2CallbackFunctions, of which only the logger is used. */
typedef struct {
    fmi2_logger logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} callbacks;

static logger logger_of(const callbacks *functions) {
    if (functions == NULL) return (logger){NULL, NULL};
    return (logger){(void (*)(void))functions->logger, functions->environment};
}

/* The functions of FMI 2.0 that only model exchange has: some hosts look for them in every FMU.
 *
 * F(name, parameters): `c` is the instance, and nothing else is looked at. */
#define MODEL_EXCHANGE_FUNCTIONS(F)                                                              \
    F(fmi2EnterEventMode, (void *c))                                                             \
    F(fmi2NewDiscreteStates, (void *c, void *events))                                            \
    F(fmi2EnterContinuousTimeMode, (void *c))                                                    \
    F(fmi2CompletedIntegratorStep, (void *c, int no_set, int *enter_events, int *terminate))     \
    F(fmi2SetTime, (void *c, double time))                                                       \
    F(fmi2SetContinuousStates, (void *c, const double x[], size_t nx))                           \
    F(fmi2GetDerivatives, (void *c, double derivatives[], size_t nx))                            \
    F(fmi2GetEventIndicators, (void *c, double indicators[], size_t ni))                         \
    F(fmi2GetContinuousStates, (void *c, double x[], size_t nx))                                 \
    F(fmi2GetNominalsOfContinuousStates, (void *c, double x_nominal[], size_t nx))

#endif
