/* The resource location. */
#include <stdlib.h>
#include <string.h>

static int hex(char digit) {
    if (digit >= '0' && digit <= '9') return digit - '0';
    digit |= 0x20;
    return digit >= 'a' && digit <= 'f' ? digit - 'a' + 10 : -1;
}

/* PythonFMU takes the path once more for a URI: it would read another folder. */
static int is_read_otherwise(string path) {
    return strstr(path, "%20") != NULL || strstr(path, "file://") != NULL;
}

/* file:///a%20b or file:/a%20b as the plain path /a b, which PythonFMU takes as it is. */
static int plain_path(string uri, char **path, message *why) {
    char *end = *path = malloc(strlen(uri) + 1);
    if (end == NULL) return compose(why, "out of memory");
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
        if (*end++ == '\0') return compose(why, "the resource location has a zero byte in it");
    }
    *end = '\0';
    if (!is_utf8(*path)) return compose(why, "the resource location is not UTF-8");
    return !is_read_otherwise(*path) ||
           compose(why, "the resources folder has %%20 or file:// in its name: rename it");
}
