/* What every call begins with, instances, and the host's states. */
#include <stdio.h>

/* Of the runtime: */

/* Begins a call of an instance, which no other thread is in then, and ends it with its status. */
static call begin(void *handle, string function, int allowed);
static int end(call *this);

/* Whether a call may come in the mode of the instance; else it fails. */
static int check_mode(call *this);

/* Logs a message of an instance. */
static void log_message(instance *it, int status, string text);

/* Makes the rest of an instance, and gives its handle; NULL, and why: it cannot be made. */
static void *new_component(instance *it, string token, string location, int visible, message *why);

/* Frees an instance, whose handle is no more; one that has no handle yet. */
static void free_component(call *this);
static void release_instance(instance *it);

/* Makes what the handle of a state stands for, of an instance or of bytes; NULL: it could not be
 * made, for want of memory if the call has not been refused. */
static void *make_saved(call *this);
static void *read_saved(call *this, const void *bytes, size_t size);

/* Its bytes, and its end. */
static size_t size_of_saved(call *this, void *saved);
static void write_saved(call *this, void *saved, void *bytes, size_t size);
static void free_saved(instance *it, void *saved);

/* Calls */

/* Whether a call goes on: only then are its arguments checked, and after them its mode. */
#define GOES_ON(call, wrong)                                                                     \
    ((call).instance != NULL && (call).status == FMI_OK && check(&(call), wrong) &&              \
     check_mode(&(call)))

/* A function of FMI: does something, unless it may not come or has a wrong argument. */
#define FUNCTION(name, allowed, wrong, parameters, ...)                                          \
    EXPORT int NAMED(name) parameters {                                                          \
        call this = begin(c, #name, allowed);                                                    \
        if (GOES_ON(this, wrong)) {                                                              \
            __VA_ARGS__;                                                                         \
        }                                                                                        \
        return end(&this);                                                                       \
    }

/* Waits until no other thread is in a call of the instance. */
static call lock_instance(void *handle, string function, int allowed) {
    call this = {.function = function, .allowed = allowed, .status = FMI_ERROR};
    string wrong;
    this.entry = lock_entry(handle, INSTANCE, &wrong);
    if (this.entry == NULL) {
        /* There is no logger to call: one that calls its instance would do so again. */
        fprintf(stderr, "%s: %s\n", function, wrong);
        return this;
    }
    this.instance = this.entry->thing;
    if (!this.instance->in_error || allowed & WHEN(AFTER_ERROR)) this.status = FMI_OK;
    return this;
}

static void log_error(instance *it, string function, string wrong) {
    message said;
    compose(&said, "%s: %s", function, wrong);
    log_message(it, FMI_ERROR, said.text);
}

/* Fails a call if anything is wrong with it; NULL: nothing is. */
static int check(call *this, string wrong) {
    if (wrong == NULL) return 1;
    this->status = FMI_ERROR;
    this->instance->in_error = 1;
    log_error(this->instance, this->function, wrong);
    return 0;
}

static void refuse_unsupported(call *this, int status) {
    message why;
    compose(&why, "FMI function not supported: %s", this->function);
    this->status = status;
    log_message(this->instance, status, why.text);
}

static void choose_messages(call *this, int logging, size_t n, const string categories[]) {
    if (!choose_categories(&this->instance->host, logging, n, categories)) {
        check(this, "out of memory");
    }
}

/* States */

/* The locked entry of a state; NULL: there is none, and the call fails. */
static entry *lock_state(call *this, void *state) {
    string wrong;
    entry *it = lock_entry(state, STATE, &wrong);
    if (it == NULL) check(this, wrong);
    return it;
}

static void free_state_of(instance *owner, entry *it) {
    free_saved(owner, it->thing);
    free_entry(it);
}

/* Whether there is a place for a state; `before` is the one that is there, locked, or NULL. */
static int check_place(call *this, void **state, entry **before) {
    *before = NULL;
    if (!check(this, wrong_place(state))) return 0;
    return *state == NULL || (*before = lock_state(this, *state)) != NULL;
}

/* Hands a state over to the host, replacing one that it already had; NULL: it could not be made,
 * for want of memory if the call has not been refused. */
static void hand_over(call *this, void *made, void **state, entry *before) {
    if (before != NULL && made != NULL) {
        free_saved(this->instance, before->thing);
        before->thing = made;
        set_owner(before, this->entry);
    } else if (made != NULL && (*state = new_handle(STATE, made, this->entry)) == NULL) {
        free_saved(this->instance, made);
        made = NULL;
    }
    if (before != NULL) unlock_entry(before);
    if (this->status == FMI_OK) check(this, made == NULL ? "out of memory" : NULL);
}

static void free_state(call *this, void **state) {
    entry *it;
    if (!check_place(this, state, &it) || it == NULL) return;
    free_state_of(this->instance, it);
    *state = NULL;
}

static void get_state(call *this, void **state) {
    entry *before;
    if (check_place(this, state, &before)) hand_over(this, make_saved(this), state, before);
}

static void size_of_state(call *this, void *state, size_t *size) {
    entry *saved;
    if (!check(this, wrong_place(size)) || (saved = lock_state(this, state)) == NULL) return;
    *size = size_of_saved(this, saved->thing);
    unlock_entry(saved);
}

static void serialise_state(call *this, void *state, void *bytes, size_t size) {
    entry *saved;
    if (!check(this, wrong_place(bytes)) || (saved = lock_state(this, state)) == NULL) return;
    int fits = size == size_of_saved(this, saved->thing);
    if (fits) write_saved(this, saved->thing, bytes, size);
    unlock_entry(saved);
    if (this->status == FMI_OK) check(this, fits ? NULL : "the state has a different size");
}

static void deserialise_state(call *this, const void *bytes, size_t size, void **state) {
    entry *before;
    if (!check(this, wrong_bytes(bytes, size)) || !check_place(this, state, &before)) return;
    hand_over(this, read_saved(this, bytes, size), state, before);
}

/* Frees all states of an instance, and its handle. */
static void free_handles(call *this) {
    void *state;
    string wrong;
    while ((state = state_of(this->entry)) != NULL) {
        entry *it = lock_entry(state, STATE, &wrong);
        if (it != NULL) free_state_of(this->instance, it);
    }
    free_entry(this->entry);
}

/* Instances */

/* A handle of a new instance; NULL, with a message that says why, if anything is wrong.
 *
 * wrong: what is, with arguments that only the version knows; NULL: nothing.
 * token_is, token: what the version calls the FMU's token, and what the host takes it for; NULL and
 *     "" go with any FMU. */
static void *instantiate(string function, string wrong, string name, string token_is, string token,
                         string location, int visible, logger host, int logging) {
    message why;
    void *handle = NULL;
    instance *it = calloc(1, sizeof *it);
    if (it == NULL) return NULL;
    if (!listen(&it->host, name, host, logging)) {
        free(it);
        return NULL;
    }
    if (check_instance(wrong, name, token_is, token, &why)) {
        handle = new_component(it, token, location, visible, &why);
    }
    if (handle == NULL) {
        if (why.length > 0) log_error(it, function, why.text);
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
    free_component(&this);
}
