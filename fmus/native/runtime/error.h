/* The first error of a call, and its reason. */
#ifndef ERROR_H
#define ERROR_H

#include <stdarg.h>

#include "text.c"

typedef struct {
    int raised;
    message why; /* the exception's class and text, or only the text of a refusal */
} Error;

/* Notes an error, unless there is one; the format is as for `compose`. */
static void raise_error(Error *error, string format, ...) {
    va_list arguments;
    if (error->raised) return;
    error->raised = 1;
    va_start(arguments, format);
    compose_from(&error->why, format, arguments);
    va_end(arguments);
}

#define raise_if(test, error, ...)                     \
    do {                                               \
        if (test) raise_error(error, __VA_ARGS__);     \
    } while (0)

#endif
