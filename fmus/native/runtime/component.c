/* The component: what the equations and ports of a model need to be an FMU. */
#include "component.h"

#include "equations.c"
#include "identity.h"
#include "instance.h"
#include "ports.h"

#include "host.c"
#include "handles.c"
#include "calls.c"
#include "messages.c"
#include "noise.c"
#include "store.c"
#include "run.c"
#include "bytes.c"
#include "state.c"
#include "guard.c"

/* Functions of FMI take more than a component has to know. */
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
