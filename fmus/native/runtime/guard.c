/* Making and freeing instances, and what every call ends with. */
#include <stdlib.h>
#include <string.h>

/* Calls */

static void give_way(void) { wait_a_moment(); }

static int fail_in_mode(call *this) {
    static const string names[] = {"instantiated", "initialising", "stepping", "terminated"};
    message why;
    compose(&why, "%s is not allowed when %s", this->function, names[this->instance->run.mode]);
    fail(this, &why);
    return 0;
}

/* Whether a call may come in the mode of the instance; else it fails. */
static int check_mode(call *this) {
    return this->allowed & WHEN(this->instance->run.mode) || fail_in_mode(this);
}

/* Lets the next call of the instance begin; the status of this one. */
static int end(call *this) {
    if (this->instance != NULL) unlock_entry(this->entry);
    return this->status;
}

static void choose_messages(call *this, int logging, size_t n, const string categories[]) {
    if (!choose_categories(&this->instance->host, logging, n, categories)) {
        check(this, "out of memory");
    }
}

/* Instances */

/* Where a GUID begins and how long it is, without braces. */
static size_t without_braces(string *token) {
    *token += strspn(*token, "{}");
    size_t length = strlen(*token);
    while (length > 0 && strchr("{}", (*token)[length - 1]) != NULL) length--;
    return length;
}

static int lower(char letter) {
    return letter >= 'A' && letter <= 'Z' ? letter - 'A' + 'a' : letter;
}

/* Whether two tokens are the same except the case of their letters. */
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

static void release_instance(instance *it) {
    release_listener(&it->host);
    free(it);
}

/* A handle of a new instance; NULL, with a message that says why, if anything is wrong.
 *
 * wrong: what is, with arguments that only the version knows; NULL: nothing.
 * token: the FMU's, with braces or without; NULL and "" go with any FMU. */
static void *instantiate(string function, string wrong, string name, string token, logger host,
                         int logging) {
    message why;
    instance *it = calloc(1, sizeof *it);
    void *handle = NULL;
    if (it == NULL) return NULL;
    if (!listen(&it->host, name, host, logging)) {
        free(it);
        return NULL;
    }
    if (check_instance(wrong, name, version.token, token, &why) && check_token(token, &why)) {
        renew(it);
        handle = new_handle(INSTANCE, it, NULL);
        if (handle == NULL) compose(&why, "out of memory");
    }
    if (handle == NULL) {
        log_error(it, function, why.text);
        release_instance(it);
    }
    return handle;
}

/* Frees an instance and its states; ignores anything that is not a live instance. */
static void free_instance(void *handle, string function) {
    if (handle == NULL) return;
    call this = begin(handle, function, MASK_FreeInstance);
    if (this.instance == NULL) return;
    free_handles(&this);
    release_instance(this.instance);
}
