/* The component as the functions of an FMI version see it: fmi2.c and fmi3.c are written over this.
 *
 * Such a file includes this one first, and component.c, so that all is one translation unit; it
 * defines what is declared under "The version". A function of FMI is then
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

typedef enum { REAL, INTEGER, BOOLEAN, ENUMERATION } fmi_type;

typedef struct instance instance;

/* A call between its beginning and its end. */
typedef struct {
    instance *instance; /* NULL: the handle belongs to no live instance */
    string function;
    int allowed; /* the modes that it may come in, of modes.h */
    int status;  /* what the call is answered with */
    void *entry; /* of the instance in the table of handles */
} call;

/* The version: it defines this, and what host.h wants of it. */

/* What it calls things. */
typedef struct {
    string types[ENUMERATION + 1]; /* of values */
    int enumerations_are_integers; /* whether they are passed as such */
    string token;             /* what tells an FMU from others */
} names;

static const names version;

/* Making and freeing */

/* A handle of a new instance; NULL, with a message that says why, if anything is wrong.
 *
 * wrong: what is, with arguments that only the version knows; NULL: nothing.
 * token: the FMU's, with braces or without; NULL and "" go with any FMU. */
static void *instantiate(string function, string wrong, string name, string token, logger host,
                         int logging);

/* Frees an instance and its states; ignores anything that is not a live instance. */
static void free_instance(void *handle, string function);

/* The frame of every other call */

/* Waits until no other thread is in a call of the instance. */
static call begin(void *handle, string function, int allowed);

/* Whether a call goes on: only then are its arguments checked, and after them its time. */
#define GOES_ON(call, wrong)                                                                     \
    ((call).status == FMI_OK && sound(&(call), wrong) && is_allowed(&(call)))

/* What is wrong, unless it is NULL, is told, and leads to FMI's error state. */
static int sound(call *this, string wrong);

/* Whether a call may come in the mode of the instance; else it fails. */
static int is_allowed(call *this);

/* Lets the next call of the instance begin; the status of this one. */
static int end(call *this);

/* Messages: errors are logged even if logging is off; no categories: all. */
static void choose_messages(call *this, int logging, size_t n, const string categories[]);
static void tell(instance *it, int status, string text);

/* Modes; a stop time that is not after the start stands for none. */
static void set_experiment(call *this, double start, double stop);
static void enter_initialisation(call *this);
static void exit_initialisation(call *this);
static void terminate(call *this);
static void reset(call *this);

/* Values. What cannot be got is given as 0. All can be got as Reals. */
static void get_reals(call *this, const uint32_t references[], size_t n, double values[]);

/* Before Integers or Booleans are got: outputs are made what they are. */
static void prepare_to_get(call *this, const uint32_t references[], size_t n);
static int32_t get_integer(call *this, uint32_t reference);
static int get_boolean(call *this, uint32_t reference);

/* All values of a call are taken, or none: they are set one by one between the beginning and the
 * end of a setting. */
typedef struct setting setting;
static setting begin_setting(call *this, fmi_type type, const uint32_t references[], size_t n);
static void set_value(setting *it, uint32_t reference, double number);
static void end_setting(setting *it);

static void set_reals(call *this, const uint32_t references[], size_t n, const double values[]);

/* References for a type that no port has; `type` is the version's name of it. */
static void get_unknown(call *this, string type, const uint32_t references[], size_t n);
static void set_unknown(call *this, string type, const uint32_t references[], size_t n);

static void take_step(call *this, double time, double step);

/* Where the run is: at the end of the last step that was taken. */
static double time_of(const call *this);

/* States: each looks at its arguments first. A handle that is not NULL is used again. */
static void get_state(call *this, void **state);
static void set_state(call *this, void *state);
static void free_state(call *this, void **state);
static void size_of_state(call *this, void *state, size_t *size);
static void serialise_state(call *this, void *state, unsigned char bytes[], size_t size);
static void deserialise_state(call *this, const unsigned char bytes[], size_t size, void **state);

#endif
