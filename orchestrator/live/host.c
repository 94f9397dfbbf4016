/* What the FMUs in the module hand their messages to. */
#include <stdlib.h>

__attribute__((import_module("host"), import_name("heard"))) void heard(void *environment,
                                                                        int status,
                                                                        const char *text);

typedef void logger(void *, const char *, int, const char *, const char *, ...);

typedef struct {
    logger *logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} callbacks;

/* A message is a format without arguments: a % stands there twice. */
static void log_message(void *environment, const char *name, int status, const char *category,
                        const char *text, ...) {
    (void)name;
    (void)category;
    heard(environment, status, text);
}

/* fmi2CallbackFunctions for one instance. */
callbacks *host_callbacks(void *environment) {
    callbacks *made = malloc(sizeof *made);
    if (made != NULL) *made = (callbacks){log_message, calloc, free, NULL, environment};
    return made;
}
