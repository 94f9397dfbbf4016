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
