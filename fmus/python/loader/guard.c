/* The host's instance, its messages, and the beginning and end of every call.
 *
 * A call locks the interpreter and its instance. It releases the interpreter first, then logs, then
 * lets the next call of the instance begin.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Messages */

/* Keeps a message for the end of the call. In a format string percent signs are doubled; slaves may
 * also log plain texts. Bytes of invalid UTF-8 become question marks. */
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

/* In FMI 2.0 a message is a format string, so each % is doubled. */
static void call_logger(const logger *host, string name, int status, string category, string text) {
    char *format = malloc(2 * strlen(text) + 1);
    if (format == NULL) return;
    copy_doubled(format, text, '%');
    ((fmi2_logger)host->function)(host->environment, name, status, category, format);
    free(format);
}

/* The logger for PythonFMU. An entry of the category "answer" is not a message: it passes the
 * status of the call, which PythonFMU cannot return, and, as hexadecimal digits of a double's bits,
 * the present time, if that does not follow from the arguments. */
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

/* The resource location */

static int hex(char digit) {
    if (digit >= '0' && digit <= '9') return digit - '0';
    digit |= 0x20;
    return digit >= 'a' && digit <= 'f' ? digit - 'a' + 10 : -1;
}

/* PythonFMU decodes the path as a URI again, and would read another folder. */
static int is_read_otherwise(string path) {
    return strstr(path, "%20") != NULL || strstr(path, "file://") != NULL;
}

/* Turns file:///a%20b or file:/a%20b into the plain path /a b, which PythonFMU accepts. */
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

/* Instances */

static void free_slave(void *slave) {
    ((void (*)(void *))pythonfmu_function("fmi2FreeInstance"))(slave);
}

static void *new_slave(instance *it, string guid, string path, int visible, message *why) {
    typedef void *(*instantiate)(string, int, string, string, const callbacks *, int, int);
    instantiate forward = (instantiate)pythonfmu_function("fmi2Instantiate");
    void *slave = forward(it->host.name, CO_SIMULATION, guid, path, &it->heard, visible, 1);
    /* Free PythonFMU's guard of the interpreter, which PythonFMU did not start, and would free
     * twice at the end of the process. */
    ((void (*)(void))pythonfmu_function("finalizePythonInterpreter"))();
    if (take_exception(why) && slave != NULL) {
        free_slave(slave);
        slave = NULL;
    }
    if (slave == NULL) forget(path);
    return slave;
}

static void *make(instance *it, string guid, string path, int visible, message *why) {
    void *handle = NULL;
    if (!load(why)) return NULL;
    int lock = py.PyGILState_Ensure();
    begin_making();
    if (preflight(path, guid, why)) it->slave = new_slave(it, guid, path, visible, why);
    end_making();
    if (it->slave != NULL) {
        handle = new_handle(INSTANCE, it, NULL);
        if (handle == NULL) free_slave(it->slave);
    }
    py.PyGILState_Release(lock);
    return handle;
}

static void *new_component(instance *it, string guid, string location, int visible, message *why) {
    char *path = NULL;
    void *handle = NULL;
    it->heard = (callbacks){.logger = log_of_slave, .environment = it};
    compose(why, "the slave cannot be created");
    if (location == NULL) {
        compose(why, "there is no resource location");
    } else if (plain_path(location, &path, why)) {
        handle = make(it, guid, path, visible, why);
    }
    free(path);
    if (it->has_logged_error) clear(why);
    log_queue(it);
    return handle;
}

static void release_instance(instance *it) {
    log_queue(it);
    release_listener(&it->host);
    free(it);
}

/* Calls */

/* True for functions that a host may call after it has ended Python; they then do nothing. */
static int is_an_end(string function) {
    return strcmp(function, "fmi2Terminate") == 0 || strcmp(function, "fmi2FreeInstance") == 0;
}

/* Begins a call, with the interpreter locked if Python runs: without it there is no instance. */
static call begin(void *handle, string function, int allowed) {
    call this = {.function = function, .status = is_an_end(function) ? FMI_OK : FMI_ERROR};
    int lock = 0, has_lock = pythonfmu != NULL;
    if (has_lock && !py.Py_IsInitialized()) {
        if (this.status != FMI_OK) fprintf(stderr, "%s: %s\n", function, ENDED);
        return this;
    }
    if (has_lock) lock = py.PyGILState_Ensure();
    this = lock_instance(handle, function, allowed);
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

/* The slave checks the mode itself. */
static int check_mode(call *this) {
    (void)this;
    return 1;
}

/* Takes the status that the slave logged for a call, for which PythonFMU returns fmi2OK. */
static void take_answer(call *this) {
    instance *it = this->instance;
    if (it->answer > this->status) this->status = it->answer;
    if (it->answer >= FMI_ERROR && !(this->allowed & WHEN(AFTER_ERROR))) it->in_error = 1;
}

/* Releases the interpreter lock, and logs the messages of the call. */
static void leave(call *this) {
    instance *it = this->instance;
    message why;
    /* PythonFMU ignores some exceptions and leaves them set, where a Python host finds them. */
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

static int end(call *this) {
    if (this->instance != NULL) {
        leave(this);
        unlock_entry(this->entry);
    }
    return this->status;
}

static void free_component(call *this) {
    if (!this->instance->is_lost) free_slave(this->instance->slave);
    leave(this);
    release_instance(this->instance);
}
