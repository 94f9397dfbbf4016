/* Default functions of FMI 2.0 for slaves in C that tests write: those that a host calls in any run do
   nothing, and all others are refused. */

#include "slave.h"

#define WEAK __attribute__((weak))

WEAK const char *fmi2GetTypesPlatform(void) { return "default"; }
WEAK const char *fmi2GetVersion(void) { return "2.0"; }
WEAK void fmi2FreeInstance(Component c) { free(c); }

#define IDLE(name) \
    WEAK Status name(void) { return OK; }
IDLE(fmi2SetDebugLogging)
IDLE(fmi2SetupExperiment)
IDLE(fmi2EnterInitializationMode)
IDLE(fmi2ExitInitializationMode)
IDLE(fmi2Terminate)
IDLE(fmi2Reset)

#define ABSENT(name) \
    WEAK Status name(void) { return Error; }
ABSENT(fmi2GetReal)
ABSENT(fmi2SetReal)
ABSENT(fmi2GetInteger)
ABSENT(fmi2SetInteger)
ABSENT(fmi2GetBoolean)
ABSENT(fmi2SetBoolean)
ABSENT(fmi2GetString)
ABSENT(fmi2SetString)
ABSENT(fmi2GetFMUstate)
ABSENT(fmi2SetFMUstate)
ABSENT(fmi2FreeFMUstate)
ABSENT(fmi2SerializedFMUstateSize)
ABSENT(fmi2SerializeFMUstate)
#ifndef LACKS
ABSENT(fmi2DeSerializeFMUstate)
#endif
ABSENT(fmi2GetDirectionalDerivative)
ABSENT(fmi2SetRealInputDerivatives)
ABSENT(fmi2GetRealOutputDerivatives)
ABSENT(fmi2CancelStep)
ABSENT(fmi2GetStatus)
ABSENT(fmi2GetRealStatus)
ABSENT(fmi2GetIntegerStatus)
ABSENT(fmi2GetBooleanStatus)
ABSENT(fmi2GetStringStatus)
