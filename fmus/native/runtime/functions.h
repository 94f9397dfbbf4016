/* The functions of FMI 2.0 for both kinds of component. Functions of an instance are defined by
 *
 *     FUNCTION(name, allowed, wrong, parameters, action)
 *     FORWARDED(name, allowed, wrong, parameters, arguments, action)
 *
 * The C kind performs the action of both. For the Python kind the loader performs the action of
 * FUNCTION, and forwards FORWARDED with these arguments to PythonFMU.
 *
 *     EXCHANGED(name, allowed, wrong, parameters, action)
 *
 * defines a function of model exchange, and EXCHANGES is true if the FMU has model exchange.
 */

EXPORT string NAMED(fmi2GetTypesPlatform)(void) { return "default"; }

EXPORT string NAMED(fmi2GetVersion)(void) { return "2.0"; }

EXPORT void *NAMED(fmi2Instantiate)(string name, int type, string guid, string location,
                                    const callbacks *functions, int visible, int logging) {
    int known = type == CO_SIMULATION || (EXCHANGES && type == MODEL_EXCHANGE);
    void *made = instantiate("fmi2Instantiate", known ? NULL : "this FMU is for co-simulation only",
                             name, "GUID", guid, location, visible, logger_of(functions), logging);
    return type == MODEL_EXCHANGE ? for_exchange(made) : made;
}

EXPORT void NAMED(fmi2FreeInstance)(void *c) { free_instance(c, "fmi2FreeInstance"); }

FUNCTION(fmi2SetDebugLogging, MASK_SetDebugLogging, wrong_texts(n, categories),
         (void *c, int on, size_t n, const string categories[]),
         choose_messages(&this, on, n, categories))

/* Modes */

FORWARDED(fmi2EnterInitializationMode, MASK_EnterInitializationMode, NULL, (void *c), (c),
          enter_initialisation(&this))
FORWARDED(fmi2ExitInitializationMode, MASK_ExitInitializationMode, NULL, (void *c), (c),
          exit_initialisation(&this))
FORWARDED(fmi2Terminate, MASK_Terminate, NULL, (void *c), (c), terminate(&this))
FORWARDED(fmi2CancelStep, MASK_NotSupported, NULL, (void *c), (c),
          refuse_unsupported(&this, FMI_ERROR))

/* Values */

#define GET(name, type, ...)                                                                     \
    FORWARDED(name, MASK_Get, wrong_values(n, r, v),                                             \
              (void *c, const uint32_t r[], size_t n, type v[]), (c, r, n, v),                   \
              prepare_to_get(&this, r, n); __VA_ARGS__)
#define SET(name, type, wrong, ...)                                                              \
    FORWARDED(name, MASK_Set, wrong, (void *c, const uint32_t r[], size_t n, const type v[]),    \
              (c, r, n, v), __VA_ARGS__)

GET(fmi2GetReal, double, if (!get_all_reals(&this, r, n, v)) GET_EACH(get_real))
GET(fmi2GetInteger, int, GET_EACH(get_integer))
GET(fmi2GetBoolean, int, GET_EACH(get_boolean))
SET(fmi2SetReal, double, wrong_values(n, r, v),
    if (!set_all_reals(&this, r, n, v)) { SET_EACH(REAL, v[k]); })
SET(fmi2SetInteger, int, wrong_values(n, r, v), SET_EACH(INTEGER, v[k]))
SET(fmi2SetBoolean, int, wrong_values(n, r, v), SET_EACH(BOOLEAN, v[k] != 0))

/* No variable is a String. */
FORWARDED(fmi2GetString, MASK_Get, wrong_values(n, r, v),
          (void *c, const uint32_t r[], size_t n, string v[]), (c, r, n, v),
          for (size_t i = 0; i < n; i++) v[i] = "";
          get_unknown(&this, "String", r, n))
SET(fmi2SetString, string, wrong_strings(n, r, v), set_unknown(&this, "String", r, n))

/* States */

FUNCTION(fmi2GetFMUstate, MASK_FMUstate, NULL, (void *c, void **state), get_state(&this, state))
FUNCTION(fmi2SetFMUstate, MASK_FMUstate, NULL, (void *c, void *state), set_state(&this, state))
FUNCTION(fmi2FreeFMUstate, MASK_FMUstate, NULL, (void *c, void **state), free_state(&this, state))
FUNCTION(fmi2SerializedFMUstateSize, MASK_FMUstate, NULL, (void *c, void *state, size_t *size),
         size_of_state(&this, state, size))
FUNCTION(fmi2SerializeFMUstate, MASK_FMUstate, NULL,
         (void *c, void *state, char bytes[], size_t size),
         serialise_state(&this, state, bytes, size))
FUNCTION(fmi2DeSerializeFMUstate, MASK_FMUstate, NULL,
         (void *c, const char bytes[], size_t size, void **state),
         deserialise_state(&this, bytes, size, state))

/* Derivatives, which the Python kind does not give. */

FORWARDED(fmi2GetDirectionalDerivative, MASK_Get, NULL,
          (void *c, const uint32_t u[], size_t nu, const uint32_t k[], size_t nk,
           const double dk[], double du[]),
          (c, u, nu, k, nk, dk, du),
          if (check(&this, wrong_values(nu, u, du)) && check(&this, wrong_values(nk, k, dk))) {
              get_directional(&this, u, nu, k, nk, dk, du);
          })

/* Unsupported functions */

FORWARDED(fmi2SetRealInputDerivatives, MASK_NotSupported, NULL,
          (void *c, const uint32_t r[], size_t n, const int order[], const double v[]),
          (c, r, n, order, v), refuse_unsupported(&this, FMI_ERROR))
FORWARDED(fmi2GetRealOutputDerivatives, MASK_NotSupported, NULL,
          (void *c, const uint32_t r[], size_t n, const int order[], double v[]),
          (c, r, n, order, v), refuse_unsupported(&this, FMI_ERROR))

#define STATUS(name, type, status)                                                               \
    FORWARDED(name, MASK_Get, wrong_place(v), (void *c, int kind, type *v), (c, kind, v),        \
              refuse_unsupported(&this, status))

STATUS(fmi2GetStatus, int, FMI_ERROR)
STATUS(fmi2GetIntegerStatus, int, FMI_DISCARD)
STATUS(fmi2GetStringStatus, string, FMI_DISCARD)

/* Returns fmi2Discard: with "true", which PythonFMU returns after each refused step, hosts would
 * end the run as a success; with "false" FMPy would repeat the step endlessly. */
FUNCTION(fmi2GetBooleanStatus, MASK_Get, wrong_place(v), (void *c, int kind, int *v), {
    *v = 0;
    this.status = FMI_DISCARD;
})

/* Functions of model exchange, which some hosts look for in every FMU. */

EXCHANGED(fmi2EnterEventMode, MASK_EnterEventMode, NULL, (void *c), enter_mode(&this, IN_EVENT))
EXCHANGED(fmi2EnterContinuousTimeMode, MASK_EnterContinuousTimeMode, NULL, (void *c),
          enter_mode(&this, INTEGRATING))
EXCHANGED(fmi2NewDiscreteStates, MASK_UpdateDiscreteStates, wrong_place(events),
          (void *c, event_info *events), {
              *events = (event_info){0};
              events->values_changed = update_discrete_states(&this);
          })
EXCHANGED(fmi2CompletedIntegratorStep, MASK_CompletedIntegratorStep,
          enter_events &&terminate ? NULL : "NULL",
          (void *c, int no_set, int *enter_events, int *terminate), *enter_events = *terminate = 0)
EXCHANGED(fmi2SetTime, MASK_SetTime, NULL, (void *c, double time), set_time(&this, time))
EXCHANGED(fmi2SetContinuousStates, MASK_SetContinuousStates, wrong_states(x, n),
          (void *c, const double x[], size_t n), set_continuous_states(&this, x))
EXCHANGED(fmi2GetContinuousStates, MASK_Get, wrong_states(x, n), (void *c, double x[], size_t n),
          get_continuous_states(&this, x))
EXCHANGED(fmi2GetDerivatives, MASK_Get, wrong_states(dx, n), (void *c, double dx[], size_t n),
          get_rates(&this, dx))
EXCHANGED(fmi2GetEventIndicators, MASK_Get, wrong_indicators(z, n), (void *c, double z[], size_t n),
          get_switches(&this, z))
EXCHANGED(fmi2GetNominalsOfContinuousStates, MASK_Get, wrong_states(x, n),
          (void *c, double x[], size_t n), get_nominals(x))
