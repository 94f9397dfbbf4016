/* What the host wants to hear, and how it is told. Errors are told even where logging is off, as
 * FMI 2.0.4 and 3.0.3 have it. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* By the statuses of messages. */
static const string CATEGORIES[] = {"logAll", "logStatusWarning", "logStatusDiscard",
                                    "logStatusError", "logStatusFatal"};

static char *copied(string text) {
    char *copy = malloc(strlen(text) + 1);
    return copy == NULL ? NULL : strcpy(copy, text);
}

static int listen(listener *it, string name, logger host, int logging) {
    *it = (listener){.host = host, .name = copied(name), .logging = logging};
    return it->name != NULL;
}

static void release_categories(listener *it) {
    for (size_t i = 0; i < it->n; i++) free(it->categories[i]);
    free(it->categories);
    it->categories = NULL;
    it->n = 0;
}

static void release_listener(listener *it) {
    release_categories(it);
    free(it->name);
}

/* Takes note of what the host wants to hear; no categories: all. 0: no memory. */
static int choose(listener *it, int logging, size_t n, const string categories[]) {
    release_categories(it);
    it->logging = logging;
    if (n == 0) return 1;
    it->categories = calloc(n, sizeof *it->categories);
    if (it->categories == NULL) return 0;
    while (it->n < n) {
        it->categories[it->n] = copied(categories[it->n]);
        if (it->categories[it->n] == NULL) return 0;
        it->n++;
    }
    return 1;
}

static int wanted(const listener *it, int status, string category) {
    if (status >= FMI_ERROR || (it->logging && it->n == 0)) return 1;
    for (size_t i = 0; it->logging && i < it->n; i++) {
        if (strcmp(it->categories[i], category) == 0) return 1;
    }
    return 0;
}

static void tell_host(const logger *host, string name, int status, string category, string text) {
    if (host->function == NULL) {
        fprintf(stderr, "%s: %s: %s\n", name, category, text);
    } else {
        deliver(host, name, status, category, text);
    }
}
