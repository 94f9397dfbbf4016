/* What the host is told.
 *
 * The host's logger takes a message for a format, PythonFMU hands on text: a percent sign that
 * stands alone is doubled. Errors are told even where logging is off.
 */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "loader.h"

static void release_categories(listener *host) {
    for (size_t i = 0; i < host->n; i++) free(host->categories[i]);
    free(host->categories);
    host->categories = NULL;
    host->n = 0;
}

/* Takes note of what the host wants to hear; no categories: all. */
int choose(listener *host, int logging, size_t n, const string categories[]) {
    release_categories(host);
    host->logging = logging;
    if (n == 0) return 1;
    host->categories = calloc(n, sizeof *host->categories);
    if (host->categories == NULL) return 0;
    while (host->n < n) {
        host->categories[host->n] = strdup(categories[host->n]);
        if (host->categories[host->n] == NULL) return 0;
        host->n++;
    }
    return 1;
}

int listen(listener *host, string name, const callbacks *functions, int logging) {
    *host = (listener){.name = strdup(name), .logging = logging};
    if (functions != NULL) host->host = *functions;
    return host->name != NULL;
}

void release_listener(listener *host) {
    release_categories(host);
    free(host->name);
}

static int wanted(const listener *host, int status, string category) {
    if (status >= FMI2_ERROR || (host->logging && host->n == 0)) return 1;
    for (size_t i = 0; host->logging && i < host->n; i++) {
        if (strcmp(host->categories[i], category) == 0) return 1;
    }
    return 0;
}

/* A text as a format that prints it. */
static char *as_format(string text) {
    int valid = is_utf8(text);
    char *format = malloc(2 * strlen(text) + 1), *end = format;
    if (format == NULL) return NULL;
    for (; *text != '\0'; text++) {
        *end++ = valid || (unsigned char)*text < 0x80 ? *text : '?';
        if (*text != '%') continue;
        *end++ = '%';
        if (text[1] == '%') text++;
    }
    *end = '\0';
    return format;
}

static string category_of(int status) {
    static const string names[] = {"logAll", "logStatusWarning", "logStatusDiscard",
                                   "logStatusError", "logStatusFatal"};
    return status >= 0 && status < (int)(sizeof names / sizeof *names) ? names[status] : names[0];
}

void tell(listener *host, int status, string category, string text) {
    if (category == NULL || category[0] == '\0') category = category_of(status);
    if (text == NULL || !wanted(host, status, category)) return;
    if (status >= FMI2_ERROR) host->told = 1;
    if (host->host.logger == NULL) {
        fprintf(stderr, "%s: %s: %s\n", host->name, category, text);
        return;
    }
    char *format = as_format(text);
    if (format == NULL) return;
    host->host.logger(host->host.environment, host->name, status, category, format);
    free(format);
}

void complain(listener *host, int status, string format, ...) {
    char text[2 * WHY];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    tell(host, status, NULL, text);
}
