/* What an instance logs, and refusals. */
#include <string.h>

static void log_message(instance *it, int status, string text) {
    if (is_wanted(&it->host, status, CATEGORIES[status])) {
        log_to_host(&it->host, status, CATEGORIES[status], text);
    }
}

/* 64-bit FNV-1a. */
static uint64_t hash(string text) {
    uint64_t sum = 0xcbf29ce484222325u;
    for (; *text != '\0'; text++) sum = (sum ^ (unsigned char)*text) * 0x100000001b3u;
    return sum;
}

/* Logs a message only the first time that its key, or else its text, occurs. */
static void log_once(instance *it, message *text, int status, string key) {
    uint64_t sum = hash(key != NULL ? key : text->text);
    for (size_t i = 0; i < it->n_logged; i++) {
        if (it->logged[i] == sum) return;
    }
    if (it->n_logged == MOST_MESSAGES) return;
    it->logged[it->n_logged++] = sum;
    if (it->n_logged == MOST_MESSAGES) append_text(text, "; further messages are not logged");
    log_message(it, status, text->text);
}

static void refuse(call *this, int status, message *why, string key) {
    this->status = status;
    if (status == FMI_DISCARD) this->instance->run.fault = 1;
    log_once(this->instance, why, status, key);
}

static void fail(call *this, message *why) {
    this->instance->in_error = 1;
    refuse(this, FMI_ERROR, why, NULL);
}
