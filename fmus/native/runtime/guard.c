/* Making and freeing instances, and what every call begins and ends with. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Calls */

static call begin(void *handle, string function, int allowed) {
    call this = {NULL, function, allowed, FMI_ERROR, NULL};
    int inside;
    entry *it = hold(handle, INSTANCE, &inside);
    if (it == NULL) {
        /* There is no one else to tell: a logger that calls would do so again. */
        fprintf(stderr, "%s: %s\n", function,
                inside ? "called by the logger" : "not a live instance of this FMU");
        return this;
    }
    this.entry = it;
    this.instance = it->thing;
    if (!this.instance->in_error || allowed & WHEN(AFTER_ERROR)) this.status = FMI_OK;
    return this;
}

static int sound(call *this, string wrong) {
    if (wrong == NULL) return 1;
    message why;
    compose(&why, "%s: %s", this->function, wrong);
    this->status = FMI_ERROR;
    this->instance->in_error = 1;
    tell(this->instance, FMI_ERROR, why.text);
    return 0;
}

static APART void come_at_the_wrong_time(call *this) {
    static const string names[] = {"instantiated", "initialising", "stepping", "terminated"};
    message why;
    compose(&why, "%s is not allowed when %s", this->function, names[this->instance->run.mode]);
    fail(this, &why);
}

static int is_allowed(call *this) {
    if (this->allowed & WHEN(this->instance->run.mode)) return 1;
    come_at_the_wrong_time(this);
    return 0;
}

static APART void end_and_tell(call *this) {
    if (this->instance->no_memory) {
        this->instance->no_memory = 0;
        sound(this, "out of memory");
    }
    let_go_and_tell(this->entry);
}

static int end(call *this) {
    instance *it = this->instance;
    if (it == NULL) return this->status;
    if (it->untold != NULL || it->no_memory) {
        end_and_tell(this);
    } else {
        let_go(this->entry);
    }
    return this->status;
}

static void choose_messages(call *this, int logging, size_t n, const string categories[]) {
    if (!sound(this, wrong_texts(n, categories))) return;
    if (!choose(&this->instance->host, logging, n, categories)) this->instance->no_memory = 1;
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

static int can_be_made(string wrong, string name, string token, message *why) {
    if (is_blank(name)) {
        compose(why, "the instance has no name");
    } else if (!is_utf8(name)) {
        compose(why, "the name of the instance is not UTF-8");
    } else if (wrong != NULL) {
        compose(why, "%s", wrong);
    } else if (token != NULL && !is_utf8(token)) {
        compose(why, "the %s is not UTF-8", version.token);
    } else if (token != NULL && token[0] != '\0' && !same_token(token, MODEL_GUID)) {
        compose(why, "%s %s does not match this FMU's, %s", version.token, token, MODEL_GUID);
    } else {
        return 1;
    }
    return 0;
}

static void release_instance(instance *it) {
    message text;
    int status;
    while (take_untold(it, &status, &text)) continue;
    release_listener(&it->host);
    free(it);
}

static void *instantiate(string function, string wrong, string name, string token, logger host,
                         int logging) {
    message why;
    instance *it = calloc(1, sizeof *it);
    void *handle = NULL;
    if (it == NULL) return NULL;
    if (!listen(&it->host, name != NULL && is_utf8(name) ? name : "?", host, logging)) {
        free(it);
        return NULL;
    }
    if (can_be_made(wrong, name, token, &why)) {
        renew(it);
        handle = new_handle(INSTANCE, it, NULL);
        if (handle == NULL) compose(&why, "out of memory");
    }
    if (handle == NULL) {
        /* Last of all: the logger need not come back. */
        message said, known_as;
        compose(&said, "%s: %s", function, why.text);
        compose(&known_as, "%s", it->host.name);
        release_instance(it);
        tell_host(&host, known_as.text, FMI_ERROR, CATEGORIES[FMI_ERROR], said.text);
    }
    return handle;
}

static void free_instance(void *handle, string function) {
    if (handle == NULL) return;
    call this = begin(handle, function, MASK_FreeInstance);
    void *state;
    int inside;
    if (this.instance == NULL) return;
    while ((state = state_of(this.entry)) != NULL) release_state(hold(state, STATE, &inside));
    drop(this.entry);
    release_instance(this.instance);
}
