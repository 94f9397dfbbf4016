/* The beginning of every call, instances, and the host's states. */
#include <stdio.h>

/* Defined by the runtime: */

/* Begins a call, and locks its instance for other threads; ends it, and returns its status. */
static call begin(void *handle, string function, int allowed);
static int end(call *this);

/* Returns true if a call is allowed in the mode of the instance; otherwise lets it fail. */
static int check_mode(call *this);

/* Logs a message of an instance. */
static void log_message(instance *it, int status, string text);

/* Completes an instance, and returns its handle; NULL, and the reason, if that is impossible. */
static void *new_component(instance *it, string token, string location, int visible, message *why);

/* Frees an instance after its handle was freed; frees an instance without a handle. */
static void free_component(call *this);
static void release_instance(instance *it);

/* Makes a state from an instance or from bytes; NULL if that failed, for lack of memory unless the
 * call has been refused. */
static void *make_saved(call *this);
static void *read_saved(call *this, const void *bytes, size_t size);

/* Size, bytes and release of a state. */
static size_t size_of_saved(call *this, void *saved);
static void write_saved(call *this, void *saved, void *bytes, size_t size);
static void free_saved(instance *it, void *saved);

/* Calls */

/* True if a call has an instance, valid arguments and an allowed mode, checked in this order. */
#define GOES_ON(call, wrong)                                                                     \
    ((call).instance != NULL && (call).status == FMI_OK && check(&(call), wrong) &&              \
     check_mode(&(call)))

/* A function of FMI: performs its action if the call is valid. */
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
        /* Not to the logger: a logger that calls its instance would do so again. */
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

/* Lets a call fail with an error message, unless that is NULL. */
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

/* Returns the locked entry of a state; if there is none, lets the call fail and returns NULL. */
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

/* Checks the place for a state; `before` is the present state in it, locked, or NULL. */
static int check_place(call *this, void **state, entry **before) {
    *before = NULL;
    if (!check(this, wrong_place(state))) return 0;
    return *state == NULL || (*before = lock_state(this, *state)) != NULL;
}

/* Passes a new state to the host in place of a former one; if it is NULL, lets the call fail for
 * lack of memory, unless the call has been refused. */
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

/* Returns the handle of a new instance; NULL, after logging the reason, if that is impossible.
 *
 * wrong: error message about arguments of only this version, or NULL.
 * token_is, token: name of the FMU's token in this version, and the host's token; NULL and "" match
 *     any FMU. */
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

/* Frees an instance and its states; ignores other handles. */
static void free_instance(void *handle, string function) {
    if (handle == NULL) return;
    call this = begin(handle, function, MASK_FreeInstance);
    if (this.instance == NULL) return;
    free_handles(&this);
    free_component(&this);
}
