/* The instance that the host holds, its messages, and the ends of every call.
 *
 * A call holds the global interpreter lock and its instance. It gives the interpreter lock back
 * first, then logs, then lets the next call of the instance begin.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Messages */

/* Notes a message for the end of the call. Percent signs of a format are doubled; those of slaves
 * that log plain texts are not. What is not UTF-8 gets question marks. */
static void queue_message(instance *it, int status, string category, string text, int is_format) {
    int valid = is_utf8(text);
    queued **place = &it->queue, *made;
    if (status >= FMI_ERROR) it->has_logged_error = 1;
    if (!is_wanted(&it->host, status, category)) return;
    made = malloc(sizeof *made + strlen(category) + 1 + strlen(text));
    if (made == NULL) return;
    made->next = NULL;
    made->status = status;
    made->text = strcpy(made->category, category) + strlen(category) + 1;
    char *end = made->text;
    for (; *text != '\0'; text++) {
        *end++ = valid || (unsigned char)*text < 0x80 ? *text : '?';
        if (is_format && text[0] == '%' && text[1] == '%') text++;
    }
    *end = '\0';
    while (*place != NULL) place = &(*place)->next;
    *place = made;
}

static void log_message(instance *it, int status, string text) {
    queue_message(it, status, CATEGORIES[status], text, 0);
}

static void log_queue(instance *it) {
    while (it->queue != NULL) {
        queued *first = it->queue;
        it->queue = first->next;
        log_to_host(&it->host, first->status, first->category, first->text);
        free(first);
    }
}

/* FMI 2.0 defines a message as a format: a host would take a % for a directive. */
static void call_logger(const logger *host, string name, int status, string category, string text) {
    char *format = malloc(2 * strlen(text) + 1);
    if (format == NULL) return;
    copy_doubled(format, text, '%');
    ((fmi2_logger)host->function)(host->environment, name, status, category, format);
    free(format);
}

/* The logger that PythonFMU gets. An entry of the category "answer" is no message: with it the
 * slave says what PythonFMU cannot, the status of the call, and as the digits of a double's bits
 * the time that it has come to, if that does not follow from the arguments. */
static void log_of_slave(void *environment, string name, int status, string category, string text,
                         ...) {
    instance *it = environment;
    int known = status >= FMI_OK && status <= FMI_FATAL;
    (void)name;
    if (category != NULL && strcmp(category, "answer") == 0) {
        if (status > it->answer) it->answer = status;
        if (text != NULL && *text != '\0') {
            uint64_t bits = strtoull(text, NULL, 16);
            memcpy(&it->time_told, &bits, sizeof bits);
        }
    } else if (text != NULL) {
        if (category == NULL || category[0] == '\0') category = CATEGORIES[known ? status : FMI_OK];
        queue_message(it, status, category, text, 1);
    }
}

/* Instances */

static instance *new_instance(string name, const callbacks *functions, int logging) {
    instance *it = calloc(1, sizeof *it);
    if (it == NULL) return NULL;
    it->heard = (callbacks){.logger = log_of_slave, .environment = it};
    if (listen(&it->host, name, logger_of(functions), logging)) return it;
    free(it);
    return NULL;
}

static void release_instance(instance *it) {
    release_listener(&it->host);
    free(it);
}

/* Calls */

/* Whether a call may be forwarded: only then are its arguments checked. */
#define GOES_ON(call, wrong)                                                                     \
    ((call).instance != NULL && (call).status == FMI_OK && check(&(call), wrong))

/* A host that ends Python first lets its instances go after that: there is nothing left to end. */
static int is_an_end(string function) {
    return strcmp(function, "fmi2Terminate") == 0 || strcmp(function, "fmi2FreeInstance") == 0;
}

/* Begins a call with the interpreter lock, if Python runs: before that there is no instance. */
static call enter(component handle, string function, int allowed) {
    call this = {.function = function, .status = is_an_end(function) ? FMI_OK : FMI_ERROR};
    int lock = 0, has_lock = pythonfmu != NULL;
    if (has_lock && !py.Py_IsInitialized()) {
        if (this.status != FMI_OK) fprintf(stderr, "%s: %s\n", function, ENDED);
        return this;
    }
    if (has_lock) lock = py.PyGILState_Ensure();
    this = begin(handle, function, allowed);
    if (this.instance != NULL) {
        this.instance->lock = lock;
        this.instance->answer = FMI_OK;
        this.instance->time_told = NAN;
        if (this.instance->is_lost) this.status = FMI_FATAL;
    } else if (has_lock) {
        py.PyGILState_Release(lock);
    }
    return this;
}

/* Takes on the status that the slave has for a call, where PythonFMU has answered fmi2OK. */
static void take_answer(call *this, int ends_in_error) {
    if (this->instance->answer > this->status) this->status = this->instance->answer;
    if (this->instance->answer >= FMI_ERROR && ends_in_error) this->instance->in_error = 1;
}

/* Gives the interpreter lock back, and logs what there is to log. */
static void leave(call *this) {
    instance *it = this->instance;
    message why;
    /* PythonFMU leaves an exception where it does not look for one; a Python host would stumble
     * over it later. */
    if (take_exception(&why) && this->status < FMI_ERROR) check(this, why.text);
    if (this->status == FMI_FATAL && !it->is_lost) {
        it->is_lost = 1;
        if (!it->has_logged_error) {
            compose(&why, "%s: failed permanently", this->function);
            log_message(it, FMI_FATAL, why.text);
        }
    }
    py.PyGILState_Release(it->lock);
    log_queue(it);
}

/* Lets the next call of the instance begin; the status of this one. */
static int end(call *this) {
    if (this->instance != NULL) {
        leave(this);
        unlock_entry(this->entry);
    }
    return this->status;
}
