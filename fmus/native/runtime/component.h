/* The component as the functions of an FMI version see it: fmi2.c and fmi3.c are written over this.
 *
 * Such a file includes this one first; it defines what is declared here, and includes component.c,
 * so that all is one translation unit. A function of FMI is then
 *
 *     call this = begin(handle, "fmi2Terminate", MASK_Terminate);
 *     if (GOES_ON(this, NULL)) terminate(&this);
 *     return end(&this);
 *
 * docs/reference/fmi-answers.md says how each call is answered.
 */
#ifndef COMPONENT_H
#define COMPONENT_H

#include "platform.h"

#include "host.h"
#include "modes.h"

/* The names of a version's functions: where a prefix for them is defined, as the standards have it,
 * several FMUs can be linked into one program. */
#define PASTE(prefix, name) prefix##name
#define PREFIXED(prefix, name) PASTE(prefix, name)

typedef enum { REAL, INTEGER, BOOLEAN, ENUMERATION } fmi_type;

/* What a version calls things. */
typedef struct {
    string types[ENUMERATION + 1]; /* of values */
    int enumerations_are_integers; /* whether they are passed as such */
    string token;                  /* what tells an FMU from others */
} names;

static const names version;

/* Whether a call goes on: only then are its arguments checked, and after them its mode. */
#define GOES_ON(call, wrong)                                                                     \
    ((call).status == FMI_OK && check(&(call), wrong) && check_mode(&(call)))

#endif
