/* The host's arguments and its logger. Errors are logged even if logging is off, as required by
 * FMI 2.0.4 and 3.0.3. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Checks of arguments, which return an error message or NULL. */

/* True if a text is NULL or only white space. */
static int is_blank(string text) {
    return text == NULL || text[strspn(text, " \t\n\v\f\r")] == '\0';
}

/* Limit for the number of values in a call. */
enum { MOST_VALUES = 1 << 20 };

/* Limit for the size of a state. */
enum { MOST_BYTES = 1 << 30 };

static string wrong_size(size_t n, const void *array) {
    if (n > MOST_VALUES) return "too many values";
    return n > 0 && array == NULL ? "no array" : NULL;
}

static string wrong_values(size_t n, const uint32_t *references, const void *values) {
    return references == NULL ? wrong_size(n, NULL) : wrong_size(n, values);
}

static string wrong_texts(size_t n, const string *texts) {
    string wrong = wrong_size(n, texts);
    for (size_t i = 0; i < n && wrong == NULL; i++) {
        if (texts[i] == NULL) {
            wrong = "a string is NULL";
        } else if (!is_utf8(texts[i])) {
            wrong = "a string is not UTF-8";
        }
    }
    return wrong;
}

static string wrong_strings(size_t n, const uint32_t *references, const string *texts) {
    return references == NULL ? wrong_size(n, NULL) : wrong_texts(n, texts);
}

static string wrong_place(const void *place) { return place == NULL ? "NULL" : NULL; }

static string wrong_bytes(const void *bytes, size_t size) {
    if (bytes == NULL) return "NULL";
    return size == 0 || size > MOST_BYTES ? "no state has that size" : NULL;
}

/* Checks the arguments for a new instance; `wrong` is an error of the version's checks, or NULL. */
static int check_instance(string wrong, string name, string token_is, string token, message *why) {
    if (is_blank(name)) return compose(why, "the instance has no name");
    if (!is_utf8(name)) return compose(why, "the name of the instance is not UTF-8");
    if (wrong != NULL) return compose(why, "%s", wrong);
    return token == NULL || is_utf8(token) || compose(why, "the %s is not UTF-8", token_is);
}

/* Logging */

/* Defined for each version of FMI: calls the logger, which is not NULL. */
static void call_logger(const logger *host, string name, int status, string category, string text);

/* Categories by status. */
static const string CATEGORIES[] = {"logAll", "logStatusWarning", "logStatusDiscard",
                                    "logStatusError", "logStatusFatal"};

static char *copied(string text) {
    char *copy = malloc(strlen(text) + 1);
    return copy == NULL ? NULL : strcpy(copy, text);
}

/* Initialises a listener; an invalid name becomes a question mark. */
static int listen(listener *it, string name, logger host, int logging) {
    *it = (listener){.host = host, .logging = logging};
    it->name = copied(name != NULL && is_utf8(name) ? name : "?");
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

/* Sets the wanted categories, or all if there are none; returns 0 if there is no memory. */
static int choose_categories(listener *it, int logging, size_t n, const string categories[]) {
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

static int is_wanted(const listener *it, int status, string category) {
    if (status >= FMI_ERROR || (it->logging && it->n == 0)) return 1;
    for (size_t i = 0; it->logging && i < it->n; i++) {
        if (strcmp(it->categories[i], category) == 0) return 1;
    }
    return 0;
}

/* Copies a text, and doubles a special character; `room` must be large enough. */
static void copy_doubled(char *room, string text, char special) {
    for (; *text != '\0'; text++) {
        if (*text == special) *room++ = *text;
        *room++ = *text;
    }
    *room = '\0';
}

/* Logs a message, even if its category is not wanted. */
static void log_to_host(const listener *it, int status, string category, string text) {
    if (it->host.function == NULL) {
        fprintf(stderr, "%s: %s: %s\n", it->name, category, text);
    } else {
        call_logger(&it->host, it->name, status, category, text);
    }
}
