/* Internal functions of the runtime, for tests. */
#include "platform.h"

#ifdef DECIMAL_COMMA
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* snprintf in a locale with a decimal comma. */
static int with_comma(char *text, size_t size, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    int length = vsnprintf(text, size, format, arguments);
    va_end(arguments);
    /* Shows a number: the first directive of a text is another. */
    if (strspn(format + 1, "+ .*0123456789") == strcspn(format + 1, "eEfgG") &&
        strchr(text, '.') != NULL) {
        *strchr(text, '.') = ',';
    }
    return length;
}
#define snprintf with_comma
#endif

#include "fmi2.c"

EXPORT void show_number(double number, int exactly, char *text) {
    message it;
    compose(&it, exactly ? "%r" : "%g", number);
    strcpy(text, it.text);
}

EXPORT void show_in(string format, double number, char *text) {
    message it;
    compose(&it, format, number);
    strcpy(text, it.text);
}

EXPORT void show_text(string text, char *shown) {
    message it;
    compose(&it, "%s", text);
    strcpy(shown, it.text);
}

EXPORT int utf8(string text) { return is_utf8(text); }

EXPORT uint32_t checksum(const unsigned char *bytes, size_t n) { return crc32(bytes, n); }

EXPORT void normal_numbers(uint32_t seed, size_t n, double *numbers) {
    generator it;
    seed_generator(&it, seed);
    for (size_t i = 0; i < n; i++) numbers[i] = standard_normal(&it);
}
