/* UTF-8, and the resource location. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "loader.h"

/* Bytes of the character that a text begins with; 0 if it is none. */
static int length_of_character(const unsigned char *text) {
    static const unsigned int smallest[] = {0, 0, 0x80, 0x800, 0x10000};
    int length = text[0] < 0x80    ? 1
                 : text[0] >> 5 == 6  ? 2
                 : text[0] >> 4 == 14 ? 3
                 : text[0] >> 3 == 30 ? 4
                                      : 0;
    if (length < 2) return length;
    unsigned int character = text[0] & (0x7f >> length);
    for (int i = 1; i < length; i++) {
        if (text[i] >> 6 != 2) return 0;
        character = character << 6 | (text[i] & 0x3f);
    }
    int surrogate = character >= 0xd800 && character <= 0xdfff;
    return character < smallest[length] || surrogate || character > 0x10ffff ? 0 : length;
}

int is_utf8(string text) {
    const unsigned char *rest = (const unsigned char *)text;
    while (*rest != '\0') {
        int length = length_of_character(rest);
        if (length == 0) return 0;
        rest += length;
    }
    return 1;
}

static int hex(char digit) {
    if (digit >= '0' && digit <= '9') return digit - '0';
    digit |= 0x20;
    return digit >= 'a' && digit <= 'f' ? digit - 'a' + 10 : -1;
}

/* PythonFMU takes the path once more for a URI: it would read another folder. */
static int read_otherwise(string path) {
    return strstr(path, "%20") != NULL || strstr(path, "file://") != NULL;
}

/* file:///a%20b or file:/a%20b as the plain path /a b, which PythonFMU takes as it is. */
int plain_path(string uri, char **path, char *why) {
    char *end = *path = malloc(strlen(uri) + 1);
    if (end == NULL) {
        snprintf(why, WHY, "no memory");
        return 0;
    }
    if (strncmp(uri, "file://", 7) == 0) {
        uri = strchr(uri + 7, '/') != NULL ? strchr(uri + 7, '/') : uri + 7;
    } else if (strncmp(uri, "file:", 5) == 0) {
        uri += 5;
    }
    while (*uri != '\0') {
        if (uri[0] == '%' && hex(uri[1]) >= 0 && hex(uri[2]) >= 0) {
            *end = (char)(16 * hex(uri[1]) + hex(uri[2]));
            uri += 3;
        } else {
            *end = *uri++;
        }
        if (*end++ == '\0') {
            snprintf(why, WHY, "the resource location has a zero byte in it");
            return 0;
        }
    }
    *end = '\0';
    if (!is_utf8(*path)) {
        snprintf(why, WHY, "the resource location is not UTF-8");
    } else if (read_otherwise(*path)) {
        snprintf(why, WHY, "the resources folder has %%20 or file:// in its name: rename it");
    } else {
        return 1;
    }
    return 0;
}
