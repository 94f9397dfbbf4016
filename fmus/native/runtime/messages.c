/* What an instance says, and when the host is told.
 *
 * The host's logger need not come back: it may leave by longjmp, or by an exception of C++. So it
 * is called at the end of a call, when all is done and the instance is let go.
 */

static void tell(instance *it, int status, string text) {
    untold **place = &it->untold, *noted;
    if (!wanted(&it->host, status, CATEGORIES[status])) return;
    noted = malloc(sizeof *noted + strlen(text));
    if (noted == NULL) return;
    noted->next = NULL;
    noted->status = status;
    strcpy(noted->text, text);
    while (*place != NULL) place = &(*place)->next;
    *place = noted;
}

/* Takes the first message of an instance that the host has not been told. */
static int take_untold(instance *it, int *status, message *text) {
    untold *first = it->untold;
    if (first == NULL) return 0;
    *status = first->status;
    compose(text, "%s", first->text);
    it->untold = first->next;
    free(first);
    return 1;
}

/* Tells the host what there is to tell, and lets go of an instance, which the logger, or another
 * thread, may free meanwhile. */
static APART void let_go_and_tell(entry *held) {
    void *handle = get_shared(&held->handle);
    message name, text;
    int status;
    MARGIN(margin);
    while (held != NULL && take_untold(held->thing, &status, &text)) {
        logger host = ((instance *)held->thing)->host.host;
        compose(&name, "%s", ((instance *)held->thing)->host.name);
        let_go_to_logger(held);
        tell_host(&host, name.text, status, CATEGORIES[status], text.text);
        held = hold_after_logger(held, handle);
    }
    if (held != NULL) let_go(held);
}

/* 64-bit FNV-1a. */
static uint64_t hash(string text) {
    uint64_t sum = 0xcbf29ce484222325u;
    for (; *text != '\0'; text++) sum = (sum ^ (unsigned char)*text) * 0x100000001b3u;
    return sum;
}

/* Logs a message only the first time that its key, or else its text, occurs. */
static void say(instance *it, message *said, int status, string key) {
    uint64_t sum = hash(key != NULL ? key : said->text);
    for (size_t i = 0; i < it->n_said; i++) {
        if (it->said[i] == sum) return;
    }
    if (it->n_said == MOST_MESSAGES) return;
    it->said[it->n_said++] = sum;
    if (it->n_said == MOST_MESSAGES) append_text(said, "; further messages are not logged");
    tell(it, status, said->text);
}

/* Refusals */

static void discard(call *this, message *why, string key) {
    this->status = FMI_DISCARD;
    this->instance->run.fault = 1;
    say(this->instance, why, FMI_DISCARD, key);
}

static void refuse_to_get(call *this, message *why) {
    this->status = FMI_ERROR;
    say(this->instance, why, FMI_ERROR, NULL);
}

static void fail(call *this, message *why) {
    this->instance->in_error = 1;
    refuse_to_get(this, why);
}
