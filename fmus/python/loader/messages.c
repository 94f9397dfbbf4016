/* What the host is told, and when.
 *
 * Its logger need not come back: it may leave by longjmp, or by an exception of C++, and take what
 * lies between with it, Python included. So it is called at the end of a call, when all is done and
 * the instance and the interpreter lock are given back.
 *
 * The host's logger takes a message for a format, PythonFMU hands on text: a percent sign that
 * stands alone is doubled.
 */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

static void deliver(const logger *host, string instance_name, int status, string category,
                    string text) {
    typedef void (*fmi2_logger)(void *, string, int, string, string, ...);
    char *format = as_format(text);
    if (format == NULL) return;
    ((fmi2_logger)host->function)(host->environment, instance_name, status, category, format);
    free(format);
}

void tell(instance *it, int status, string category, string text) {
    int known = status >= FMI_OK && status <= FMI_FATAL;
    if (text == NULL) return;
    if (category == NULL || category[0] == '\0') category = CATEGORIES[known ? status : FMI_OK];
    if (status >= FMI_ERROR) it->told = 1;
    if (!wanted(&it->host, status, category)) return;
    size_t name_size = strlen(it->host.name) + 1, category_size = strlen(category) + 1;
    untold **place = &it->untold,
           *noted = malloc(sizeof *noted + name_size + category_size + strlen(text));
    if (noted == NULL) return;
    *noted = (untold){.status = status};
    noted->category = noted->name + name_size;
    noted->text = noted->category + category_size;
    strcpy(noted->name, it->host.name);
    strcpy(noted->category, category);
    strcpy(noted->text, text);
    while (*place != NULL) place = &(*place)->next;
    *place = noted;
}

/* Tells the host messages of an instance, which it may free meanwhile. */
void tell_all(logger host, untold *messages) {
    for (untold *next; messages != NULL; messages = next) {
        next = messages->next;
        tell_host(&host, messages->name, messages->status, messages->category, messages->text);
        free(messages);
    }
}

void complain(instance *it, int status, string format, ...) {
    char text[2 * WHY];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    tell(it, status, NULL, text);
}
