/* The resource location. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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
        snprintf(why, WHY, "out of memory");
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
