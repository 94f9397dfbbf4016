/* What every call begins with, and the host's states. */
#include <stdio.h>

/* Of the runtime: logs a message of an instance; frees what the handle of a state stands for. */
static void log_message(instance *it, int status, string text);
static void free_saved(instance *it, void *saved);

/* Waits until no other thread is in a call of the instance. */
static call begin(void *handle, string function, int allowed) {
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
