/* Instances, their messages, and refusals. */
#include <stdlib.h>
#include <string.h>

/* Messages */

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

/* Logs a message, only the first time that its key, or else its text, occurs. */
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

/* Calls */

static void give_way(void) { wait_a_moment(); }

static call begin(void *handle, string function, int allowed) {
    return lock_instance(handle, function, allowed);
}

static int check_mode(call *this) {
    static const string names[] = {
        "instantiated",  "initialising",
        "stepping",      "in event mode",
        "in continuous-time mode", "terminated",
    };
    message why;
    if (this->allowed & WHEN(this->instance->run.mode)) return 1;
    compose(&why, "%s is not allowed when %s", this->function, names[this->instance->run.mode]);
    fail(this, &why);
    return 0;
}

static int end(call *this) {
    if (this->instance != NULL) unlock_entry(this->entry);
    return this->status;
}

/* Instances */

/* Resets everything to the values after instantiation. */
static void renew(instance *it);

/* Moves to the beginning of a GUID after braces, and returns its length without them. */
static size_t without_braces(string *token) {
    *token += strspn(*token, "{}");
    size_t length = strlen(*token);
    while (length > 0 && strchr("{}", (*token)[length - 1]) != NULL) length--;
    return length;
}

static int lower(char letter) {
    return letter >= 'A' && letter <= 'Z' ? letter - 'A' + 'a' : letter;
}

/* Compares two tokens, ignoring braces and case. */
static int same_token(string one, string other) {
    size_t length = without_braces(&one);
    if (without_braces(&other) != length) return 0;
    for (size_t i = 0; i < length; i++) {
        if (lower(one[i]) != lower(other[i])) return 0;
    }
    return 1;
}

static int check_token(string token, message *why) {
    return token == NULL || token[0] == '\0' || same_token(token, MODEL_GUID) ||
           compose(why, "%s %s does not match this FMU's, %s", version.token, token, MODEL_GUID);
}

static void *new_component(instance *it, string token, string location, int visible, message *why) {
    (void)location, (void)visible;
    if (!check_token(token, why)) return NULL;
    renew(it);
    compose(why, "out of memory");
    return new_handle(INSTANCE, it, NULL);
}

static void release_instance(instance *it) {
    release_listener(&it->host);
    free(it);
}

static void free_component(call *this) { release_instance(this->instance); }
