/* Messages: UTF-8 of bounded length, with numbers as in Python, independent of the locale. */
#ifndef TEXT_C
#define TEXT_C

#include <ctype.h>
#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host.h"

/* UTF-8 */

/* Returns the number of bytes of the first character of a text; 0 if it is not UTF-8. */
static int length_of_character(const char *text) {
    static const uint32_t smallest[] = {0, 0, 0x80, 0x800, 0x10000};
    const unsigned char *bytes = (const unsigned char *)text;
    int length = bytes[0] < 0x80      ? 1
                 : bytes[0] >> 5 == 6  ? 2
                 : bytes[0] >> 4 == 14 ? 3
                 : bytes[0] >> 3 == 30 ? 4
                                       : 0;
    if (length < 2) return length;
    uint32_t character = bytes[0] & (0x7fu >> length);
    for (int i = 1; i < length; i++) {
        if (bytes[i] >> 6 != 2) return 0;
        character = character << 6 | (bytes[i] & 0x3f);
    }
    int surrogate = character >= 0xd800 && character <= 0xdfff;
    return character < smallest[length] || surrogate || character > 0x10ffff ? 0 : length;
}

static int is_utf8(const char *text) {
    while (*text != '\0') {
        int length = length_of_character(text);
        if (length == 0) return 0;
        text += length;
    }
    return 1;
}

/* Messages */

/* Some hosts have buffers of 1 or 2 kB for messages. A character has at most four bytes. */
enum { MOST_CHARACTERS = 500, MOST_TEXT = 4 * MOST_CHARACTERS };

typedef struct {
    int characters;
    size_t length; /* in bytes */
    char text[MOST_TEXT + 1];
} message;

/* Appends bytes up to the limit; UTF-8 is cut after a whole character. */
static void append_bytes(message *it, string bytes, size_t n) {
    string end = bytes + n;
    while (bytes < end && it->characters < MOST_CHARACTERS && it->length < MOST_TEXT) {
        do {
            it->text[it->length++] = *bytes++;
        } while (bytes < end && ((unsigned char)*bytes & 0xc0) == 0x80 && it->length < MOST_TEXT);
        it->characters++;
    }
    it->text[it->length] = '\0';
}

static void append_text(message *it, string text) { append_bytes(it, text, strlen(text)); }

static void clear(message *it) {
    it->characters = 0;
    it->length = 0;
    it->text[0] = '\0';
}

/* Numbers */

/* Digits that identify a double, and the range of numbers that Python writes without exponent. */
enum { ALL_DIGITS = 17, SMALLEST_EXPONENT = -4, LARGEST_EXPONENT = 15 };

/* A number as 0.digits * 10^point. */
typedef struct {
    char digits[ALL_DIGITS + 1];
    int point;
} decimal;

static decimal rounded(double magnitude, int n) {
    decimal it = {.point = 1};
    char text[ALL_DIGITS + 16], *next = text, *end = it.digits;
    snprintf(text, sizeof text, "%.*e", n - 1, magnitude);
    /* Skip the decimal point, which depends on the locale. */
    for (; *next != 'e'; next++) {
        if (isdigit((unsigned char)*next)) *end++ = *next;
    }
    it.point += atoi(next + 1);
    return it;
}

static int reads_back(const decimal *it, double magnitude) {
    char text[ALL_DIGITS + 16];
    snprintf(text, sizeof text, "%se%d", it->digits, it->point - (int)strlen(it->digits));
    return strtod(text, NULL) == magnitude;
}

static decimal next_above(decimal it) {
    char *last = it.digits + strlen(it.digits) - 1;
    while (last >= it.digits && *last == '9') *last-- = '0';
    if (last >= it.digits) {
        ++*last;
    } else {
        it.digits[0] = '1';
        it.point++;
    }
    return it;
}

/* Returns the shortest digits that read back as the number. */
static decimal shortest(double magnitude) {
    int exponent;
    /* Below a power of two, numbers are closer together than above it: the nearest digits may be
     * too far below it, while the next digits above are near enough. */
    int power_of_two = frexp(magnitude, &exponent) == 0.5;
    for (int n = 1;; n++) {
        decimal it = rounded(magnitude, n);
        if (n == ALL_DIGITS || reads_back(&it, magnitude)) return it;
        decimal above = next_above(it);
        if (power_of_two && reads_back(&above, magnitude)) return above;
    }
}

/* Appends a number as Python's repr shows it. */
static void append_exactly(message *it, double number) {
    char text[ALL_DIGITS + 16] = "", *end = text;
    if (isnan(number) || isinf(number)) {
        append_text(it, isnan(number) ? "nan" : number > 0.0 ? "inf" : "-inf");
        return;
    }
    decimal said = shortest(fabs(number));
    int n = (int)strlen(said.digits), exponent = said.point - 1;
    while (n > 1 && said.digits[n - 1] == '0') n--;
    if (signbit(number)) *end++ = '-';
    if (exponent < SMALLEST_EXPONENT || exponent > LARGEST_EXPONENT) {
        snprintf(end, sizeof text - 1, "%c%s%.*se%c%02d", said.digits[0], n > 1 ? "." : "", n - 1,
                 said.digits + 1, exponent < 0 ? '-' : '+', abs(exponent));
    } else {
        /* The digit i is the units digit if i is the exponent. */
        for (int i = exponent < 0 ? exponent : 0; i < n || i <= exponent; i++) {
            *end++ = i < 0 || i >= n ? '0' : said.digits[i];
            if (i == exponent && i + 1 < n) *end++ = '.';
        }
        if (n <= exponent + 1) memcpy(end, ".0", sizeof ".0");
    }
    append_text(it, text);
}

/* Appends a number in a format of printf. NaN has no sign, as in Python. */
static void append_number(message *it, string directive, double number) {
    char text[MOST_TEXT + 1], *end = text;
    snprintf(text, sizeof text, directive, isnan(number) ? fabs(number) : number);
    for (string next = text; *next != '\0'; next++) {
        if (strchr("+- ", *next) != NULL || isalnum((unsigned char)*next)) {
            *end++ = *next;
        } else if (end[-1] != '.') {
            /* Replace the decimal point, which depends on the locale. */
            *end++ = '.';
        }
    }
    *end = '\0';
    append_text(it, text);
}

/* Characters between the % and the letter of a directive, and its longest length. */
static const char MODIFIERS[] = "+ .0123456789";
enum { LONGEST_DIRECTIVE = 16 };

/* Writes a message: %s is a text, %r a double exactly, %d an integer, %u a reference, %% a percent
 * sign; other directives, such as %g or %+.2f, format a double as printf does. */
static void compose_from(message *it, string format, va_list arguments) {
    clear(it);
    while (*format != '\0') {
        size_t plain = strcspn(format, "%");
        append_bytes(it, format, plain);
        format += plain;
        if (*format == '\0') break;
        char directive[LONGEST_DIRECTIVE] = "", number[16];
        size_t length = 2 + strspn(format + 1, MODIFIERS);
        char letter = format[length - 1];
        switch (letter) {
            case '%': append_text(it, "%"); break;
            case 's': append_text(it, va_arg(arguments, string)); break;
            case 'r': append_exactly(it, va_arg(arguments, double)); break;
            case 'd':
                snprintf(number, sizeof number, "%d", va_arg(arguments, int));
                append_text(it, number);
                break;
            case 'u':
                snprintf(number, sizeof number, "%lu", (unsigned long)va_arg(arguments, uint32_t));
                append_text(it, number);
                break;
            default:
                memcpy(directive, format, length);
                append_number(it, directive, va_arg(arguments, double));
        }
        format += length;
    }
}

/* Writes a message, and returns 0, so that a function that fails can return the result. */
static int compose(message *it, string format, ...) {
    va_list arguments;
    va_start(arguments, format);
    compose_from(it, format, arguments);
    va_end(arguments);
    return 0;
}

#endif
