/* What an instance says. */

static void tell(instance *it, int status, string text) {
    tell_listener(&it->host, status, NULL, text);
}

/* 64-bit FNV-1a. */
static uint64_t hash(string text) {
    uint64_t sum = 0xcbf29ce484222325u;
    for (; *text != '\0'; text++) sum = (sum ^ (unsigned char)*text) * 0x100000001b3u;
    return sum;
}

/* Logs a message, the first time only that its key, or else its text, comes up. */
static void say(instance *it, message *said, int status, string key) {
    uint64_t sum = hash(key != NULL ? key : said->text);
    for (size_t i = 0; i < it->n_said; i++) {
        if (it->said[i] == sum) return;
    }
    if (it->n_said == MOST_MESSAGES) return;
    it->said[it->n_said++] = sum;
    if (it->n_said == MOST_MESSAGES) append_text(said, "; what comes after this is not logged");
    tell(it, status, said->text);
}
