/* The instance that the host holds, and what every call begins and ends with.
 *
 * A call holds the global interpreter lock from its beginning to its end, and its instance is
 * marked: a call of the same instance from another thread waits, one from the host's logger, which
 * is told what there is to tell after that, is refused.
 */
#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The logger that PythonFMU gets. An entry of the category "answer" is no message: with it the
 * slave says what PythonFMU cannot, the status of the call, and as the digits of a double's bits
 * the time that it has come to, if that does not follow from the arguments. */
static void hear(void *environment, string name, int status, string category, string text, ...) {
    instance *it = environment;
    (void)name;
    if (category == NULL || strcmp(category, "answer") != 0) {
        tell(it, status, category, text);
    } else {
        if (status > it->answer) it->answer = status;
        if (text != NULL && *text != '\0') {
            uint64_t bits = strtoull(text, NULL, 16);
            memcpy(&it->time_told, &bits, sizeof bits);
        }
    }
}

instance *new_instance(string name, const callbacks *functions, int logging) {
    instance *it = calloc(1, sizeof *it);
    logger host = {NULL, NULL};
    if (it == NULL) return NULL;
    it->heard = (callbacks){.logger = hear, .environment = it};
    if (functions != NULL) {
        host = (logger){(void (*)(void))functions->logger, functions->environment};
    }
    if (!listen(&it->host, name, host, logging)) {
        free(it);
        return NULL;
    }
    return it;
}

void release_instance(instance *it) {
    for (untold *next; it->untold != NULL; it->untold = next) {
        next = it->untold->next;
        free(it->untold);
    }
    release_listener(&it->host);
    free(it);
}

/* The instance of a handle, once no other thread is in a call of it. */
static instance *awaited(component handle) {
    instance *it;
    while ((it = thing_of(handle, INSTANCE)) != NULL && it->busy &&
           !pthread_equal(it->thread, pthread_self())) {
        wait_without_lock();
    }
    return it;
}

/* Where the logger is called from. */
static APART void mark_teller(instance *it) {
    it->telling = 1;
    it->teller = pthread_self();
    it->depth = DEPTH();
}

static int is_teller(const instance *it) {
    return it->telling && pthread_equal(it->teller, pthread_self());
}

/* Whether the logger calls, which this thread tells something. One that has been left does not: the
 * stack does not reach down to it any more. */
static int is_in_logger(instance *it) {
    if (!is_teller(it)) return 0;
    it->telling = DEPTH() < it->depth;
    return it->telling;
}

/* A host that ends Python first lets its instances go after that: there is nothing left to end. */
static int lets_go(string function) {
    return strcmp(function, "fmi2Terminate") == 0 || strcmp(function, "fmi2FreeInstance") == 0;
}

call begin(component handle, string function, int allowed) {
    call this = {.function = function, .status = FMI_ERROR, .handle = handle};
    string wrong = "not a live instance of this FMU";
    instance *it = NULL;
    if (python_runs()) {
        this.lock = py.PyGILState_Ensure();
        it = awaited(handle);
        if (it != NULL) wrong = it->busy || is_in_logger(it) ? "called by the logger" : NULL;
        if (wrong != NULL) py.PyGILState_Release(this.lock);
    } else if (has_loaded()) {
        if (lets_go(function)) this.status = FMI_OK;
        wrong = "the host has ended Python";
    }
    if (wrong != NULL) {
        /* There is no one else to tell: a logger that calls would do so again. */
        if (this.status != FMI_OK) fprintf(stderr, "%s: %s\n", function, wrong);
        return this;
    }
    this.instance = it;
    it->answer = FMI_OK;
    it->time_told = NAN;
    it->busy = 1;
    it->thread = pthread_self();
    if (it->condition == LOST) {
        this.status = FMI_FATAL;
    } else if (it->condition == SOUND || allowed & WHEN(AFTER_ERROR)) {
        this.status = FMI_OK;
    }
    return this;
}

/* The arguments are wrong: the instance is in FMI's error state from now on. */
int refuse(call *this, string wrong) {
    this->status = FMI_ERROR;
    this->instance->condition = IN_ERROR;
    complain(this->instance, FMI_ERROR, "%s: %s", this->function, wrong);
    return 0;
}

int sound(call *this, string wrong) { return wrong == NULL || refuse(this, wrong); }

/* Takes on the status that the slave has for a call, where PythonFMU has answered fmi2OK. */
void take_answer(call *this, int ends_in_error) {
    if (this->instance->answer > this->status) this->status = this->instance->answer;
    if (this->instance->answer >= FMI_ERROR && ends_in_error) this->instance->condition = IN_ERROR;
}

/* Gives the lock back, and tells the host what there is to tell. */
void give_back_and_tell(call *this) {
    instance *it = this->instance;
    untold *messages = it->untold;
    logger host = it->host.host;
    MARGIN(margin);
    it->untold = NULL;
    if (messages != NULL) mark_teller(it);
    py.PyGILState_Release(this->lock);
    if (messages == NULL) return;
    tell_all(host, messages);
    if (!python_runs()) return;
    this->lock = py.PyGILState_Ensure();
    /* It may have been freed meanwhile. */
    if (thing_of(this->handle, INSTANCE) == it && is_teller(it)) it->telling = 0;
    py.PyGILState_Release(this->lock);
}

int end(call *this) {
    instance *it = this->instance;
    char why[WHY];
    if (it == NULL) return this->status;
    /* PythonFMU leaves an exception where it does not look for one; a Python host would stumble
     * over it later. */
    if (exception(why) && this->status < FMI_ERROR) refuse(this, why);
    if (this->status == FMI_FATAL && it->condition != LOST) {
        it->condition = LOST;
        if (!it->told) complain(it, FMI_FATAL, "%s: failed permanently", this->function);
    }
    it->busy = 0;
    give_back_and_tell(this);
    return this->status;
}
