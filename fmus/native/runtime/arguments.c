/* What can be wrong with texts and arrays of arguments. */
#include <string.h>

/* Whether a text is not there, or has nothing but white space. */
static int is_blank(string text) {
    return text == NULL || text[strspn(text, " \t\n\v\f\r")] == '\0';
}

/* More values in one call than any FMU has. */
enum { MOST_VALUES = 1 << 20 };

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
