/* Modes of an instance, and those in which a function may be called; in any other it is an error.
 *
 * docs/reference/fmi-answers.md has every call in every mode, and says why more is allowed here
 * than in the standards. */
#ifndef MODES_H
#define MODES_H

/* The last one, FMI's state error, may be had in each of the others. */
typedef enum { INSTANTIATED, INITIALISING, STEPPING, TERMINATED, AFTER_ERROR } mode;

#define WHEN(mode) (1 << (mode))
#define BEFORE_THE_END (WHEN(INSTANTIATED) | WHEN(INITIALISING) | WHEN(STEPPING))
#define NOT_AFTER_ERROR (BEFORE_THE_END | WHEN(TERMINATED))
#define ALWAYS (NOT_AFTER_ERROR | WHEN(AFTER_ERROR))

#define MASK_SetDebugLogging ALWAYS
#define MASK_SetupExperiment WHEN(INSTANTIATED)
#define MASK_EnterInitializationMode WHEN(INSTANTIATED)
#define MASK_ExitInitializationMode WHEN(INITIALISING)
#define MASK_DoStep WHEN(STEPPING)
#define MASK_Terminate NOT_AFTER_ERROR
#define MASK_Reset ALWAYS
#define MASK_FreeInstance ALWAYS
#define MASK_Get ALWAYS /* values, and what is known of a step */
#define MASK_Set BEFORE_THE_END
#define MASK_FMUstate ALWAYS     /* all functions about states */
#define MASK_NotSupported ALWAYS /* all others */

#endif
