/* Texts of messages: of bounded length, with numbers as Python writes them in any locale. */
#include <ctype.h>
#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Adds a text, which is UTF-8, as far as it has room. */
static void append_text(message *it, string text) {
    while (*text != '\0' && it->characters < MOST_CHARACTERS) {
        do {
            it->text[it->length++] = *text++;
        } while (((unsigned char)*text & 0xc0) == 0x80);
        it->characters++;
    }
    it->text[it->length] = '\0';
}

static void clear(message *it) {
    it->characters = 0;
    it->length = 0;
    it->text[0] = '\0';
}

/* Numbers */

/* Digits that tell any number from all others, that %g gives, and the exponents from which Python
 * and %g write an exponent. */
enum { ALL_DIGITS = 17, SHORT_DIGITS = 6, REPR_EXPONENT = 16, SMALLEST_EXPONENT = -4 };

/* A number as 0.digits * 10^point. */
typedef struct {
    char digits[ALL_DIGITS + 1];
    int point;
} decimal;

static decimal rounded(double magnitude, int n) {
    decimal it = {.point = 1};
    char text[ALL_DIGITS + 16], *next = text, *end = it.digits;
    snprintf(text, sizeof text, "%.*e", n - 1, magnitude);
    /* Between the digits is what the locale puts there. */
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

/* The fewest digits that read back as the number. */
static decimal shortest(double magnitude) {
    int exponent;
    /* Below a power of two numbers lie closer than above it: the nearest digits may be too far
     * below it, and those above near enough. */
    int power_of_two = frexp(magnitude, &exponent) == 0.5;
    for (int n = 1;; n++) {
        decimal it = rounded(magnitude, n);
        if (n == ALL_DIGITS || reads_back(&it, magnitude)) return it;
        decimal above = next_above(it);
        if (power_of_two && reads_back(&above, magnitude)) return above;
    }
}

static void append_number(message *it, double number, int exactly) {
    char text[ALL_DIGITS + 16] = "", *end = text;
    if (isnan(number) || isinf(number)) {
        append_text(it, isnan(number) ? "nan" : number > 0.0 ? "inf" : "-inf");
        return;
    }
    decimal said = exactly ? shortest(fabs(number)) : rounded(fabs(number), SHORT_DIGITS);
    int n = (int)strlen(said.digits), exponent = said.point - 1;
    while (n > 1 && said.digits[n - 1] == '0') n--;
    if (signbit(number)) *end++ = '-';
    if (exponent < SMALLEST_EXPONENT || exponent >= (exactly ? REPR_EXPONENT : SHORT_DIGITS)) {
        snprintf(end, sizeof text - 1, "%c%s%.*se%c%02d", said.digits[0], n > 1 ? "." : "", n - 1,
                 said.digits + 1, exponent < 0 ? '-' : '+', abs(exponent));
    } else {
        /* The digit i stands for units if i is the exponent. */
        for (int i = exponent < 0 ? exponent : 0; i < n || i <= exponent; i++) {
            *end++ = i < 0 || i >= n ? '0' : said.digits[i];
            if (i == exponent && i + 1 < n) *end++ = '.';
        }
        if (exactly && n <= exponent + 1) memcpy(end, ".0", sizeof ".0");
    }
    append_text(it, text);
}

/* A text as Python's repr shows it, except rare characters that it takes to be unprintable. */
static void append_quoted(message *it, string text) {
    char quote = strchr(text, '\'') != NULL && strchr(text, '"') == NULL ? '"' : '\'';
    char ends[] = {quote, '\0'};
    append_text(it, ends);
    while (*text != '\0' && it->characters < MOST_CHARACTERS) {
        char shown[16];
        uint32_t character;
        int length = character_of(text, &character);
        int unprintable = character < 0x20 || (character >= 0x7f && character <= 0xa0) ||
                          character == 0xad;
        if (character == '\\' || character == (unsigned char)quote) {
            snprintf(shown, sizeof shown, "\\%c", (char)character);
        } else if (character == '\t' || character == '\n' || character == '\r') {
            snprintf(shown, sizeof shown, "\\%c", "tn\0\0r"[character - '\t']);
        } else if (unprintable) {
            snprintf(shown, sizeof shown, "\\x%02x", (unsigned)character);
        } else {
            snprintf(shown, sizeof shown, "%.*s", length, text);
        }
        append_text(it, shown);
        text += length;
    }
    append_text(it, ends);
}

/* Writes a text: %s is a text; %q a text in quotes; %g a number in short; %r a number exactly; %f a
 * number without a fraction; %u a reference. Gives 0, with which a function fails. */
static int compose(message *it, string format, ...) {
    va_list arguments;
    va_start(arguments, format);
    clear(it);
    for (char one[2] = ""; *format != '\0'; format++) {
        char number[DBL_MAX_10_EXP + 4];
        if (*format != '%') {
            one[0] = *format;
            append_text(it, one);
            continue;
        }
        switch (*++format) {
            case 's': append_text(it, va_arg(arguments, string)); break;
            case 'q': append_quoted(it, va_arg(arguments, string)); break;
            case 'g': append_number(it, va_arg(arguments, double), 0); break;
            case 'r': append_number(it, va_arg(arguments, double), 1); break;
            case 'f':
                snprintf(number, sizeof number, "%.0f", va_arg(arguments, double));
                append_text(it, number);
                break;
            case 'u':
                snprintf(number, sizeof number, "%lu", (unsigned long)va_arg(arguments, uint32_t));
                append_text(it, number);
                break;
        }
    }
    va_end(arguments);
    return 0;
}
