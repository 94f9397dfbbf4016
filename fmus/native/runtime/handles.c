/* Tells what is alive from what is not.
 *
 * The host gets numbers for instances and states, no addresses: a number is given once in the life
 * of a process, so that what was freed, what belongs to another FMU, and what is none are told from
 * what is alive, without looking where a wrong address points to. (Where a pointer has 32 bits, a
 * number comes again after some thousand.)
 *
 * A call holds the entry of its instance, or state, from its beginning to its end. Entries stay
 * where they are, so that they can be looked up while others come and go.
 */
#include <stdlib.h>

/* The lower bits of a handle are its place among the entries, the others the serial number. */
enum { PLACE_BITS = 20, CHUNK_BITS = 10 };

#define CHUNK_SIZE ((size_t)1 << CHUNK_BITS)
#define MOST_ENTRIES ((size_t)1 << PLACE_BITS)

typedef enum { INSTANCE, STATE } thing_kind;

typedef struct entry entry;
struct entry {
    shared handle; /* NULL: free */
    shared thread; /* that holds it; NULL: none; LOGGER: none, and its logger was called */
    size_t place;
    thing_kind kind;
    void *thing;
    entry *owner, *states;  /* of a state; of an instance */
    entry *next, *previous; /* states of the same owner; free entries */
    void *teller;           /* the thread that has called the logger */
    uintptr_t depth;        /* of its stack then */
};

static char logger_place;
#define LOGGER ((void *)&logger_place)

/* Most processes need no more than the first chunk. Place 0 holds nothing: no handle is NULL. */
static entry first_chunk[CHUNK_SIZE];
static shared chunks[MOST_ENTRIES >> CHUNK_BITS];

/* The thread that changes what follows, and the links of entries; NULL: none. */
static shared table_thread;
static entry *free_entries;
static size_t n_entries;
static uint64_t serial;

static void lock_table(void) {
    while (!swap_shared(&table_thread, NULL, this_thread())) wait_a_moment();
}

static void unlock_table(void) { put_shared(&table_thread, NULL); }

/* Another number for each address. */
static uint64_t mixed(uint64_t number) {
    number = (number ^ number >> 30) * 0xbf58476d1ce4e5b9u;
    number = (number ^ number >> 27) * 0x94d049bb133111ebu;
    return number ^ number >> 31;
}

/* Makes room for one more entry. */
static int grow(void) {
    if (n_entries == 0) {
        /* Each FMU, and each copy of one in the process, begins elsewhere. */
        serial = mixed((uintptr_t)first_chunk);
        put_shared(&chunks[0], first_chunk);
        n_entries = 1;
    }
    if (n_entries == MOST_ENTRIES) return 0;
    if (n_entries % CHUNK_SIZE == 0) {
        entry *chunk = calloc(CHUNK_SIZE, sizeof *chunk);
        if (chunk == NULL) return 0;
        put_shared(&chunks[n_entries >> CHUNK_BITS], chunk);
    }
    entry *chunk = get_shared(&chunks[n_entries >> CHUNK_BITS]);
    free_entries = &chunk[n_entries % CHUNK_SIZE];
    free_entries->place = n_entries++;
    return 1;
}

static void link_to(entry *it, entry *owner) {
    it->owner = owner;
    if (owner == NULL) return;
    it->previous = NULL;
    it->next = owner->states;
    if (it->next != NULL) it->next->previous = it;
    owner->states = it;
}

static void unlink_from_owner(entry *it) {
    if (it->owner == NULL) return;
    if (it->next != NULL) it->next->previous = it->previous;
    if (it->previous != NULL) {
        it->previous->next = it->next;
    } else {
        it->owner->states = it->next;
    }
}

/* NULL if there is no memory for another one. */
static void *new_handle(thing_kind kind, void *thing, entry *owner) {
    void *handle = NULL;
    lock_table();
    if (free_entries != NULL || grow()) {
        entry *it = free_entries;
        free_entries = it->next;
        it->kind = kind;
        it->thing = thing;
        it->states = NULL;
        link_to(it, owner);
        handle = (void *)((uintptr_t)(++serial << PLACE_BITS) | it->place);
        put_shared(&it->handle, handle);
    }
    unlock_table();
    return handle;
}

static int is_alive(entry *it, void *handle) {
    return it != NULL && get_shared(&it->handle) == handle && handle != NULL;
}

/* Lets the entry of an instance go while its logger is called. */
static APART void let_go_to_logger(entry *it) {
    it->teller = this_thread();
    it->depth = DEPTH();
    put_shared(&it->thread, LOGGER);
}

/* Holds an entry whose logger was called, unless the logger calls now, which `inside` tells: the
 * stack reaches down to it. To one that was left, by longjmp or an exception of C++, it does not. */
static APART int take_from_logger(entry *it, int *inside) {
    if (!swap_shared(&it->thread, LOGGER, this_thread())) return 0;
    *inside = it->teller == this_thread() && DEPTH() < it->depth;
    if (*inside) put_shared(&it->thread, LOGGER);
    return !*inside;
}

/* The entry of a handle, which no other thread holds until it is let go; NULL if there is none, or
 * if this thread is in a call of it already, which `inside` tells. */
static entry *hold(void *handle, thing_kind kind, int *inside) {
    size_t place = (uintptr_t)handle & (MOST_ENTRIES - 1);
    entry *chunk = get_shared(&chunks[place >> CHUNK_BITS]);
    entry *it = chunk == NULL ? NULL : &chunk[place & (CHUNK_SIZE - 1)];
    *inside = 0;
    while (is_alive(it, handle)) {
        if (swap_shared(&it->thread, NULL, this_thread()) || take_from_logger(it, inside)) {
            if (is_alive(it, handle) && it->kind == kind) return it;
            put_shared(&it->thread, NULL);
            return NULL;
        }
        *inside |= get_shared(&it->thread) == this_thread();
        if (*inside) return NULL;
        wait_a_moment();
    }
    return NULL;
}

/* Holds an entry again after the logger has come back; NULL: it is the handle's no more. */
static entry *hold_after_logger(entry *it, void *handle) {
    int inside;
    if (!swap_shared(&it->thread, LOGGER, this_thread())) return hold(handle, INSTANCE, &inside);
    if (is_alive(it, handle)) return it;
    put_shared(&it->thread, LOGGER);
    return NULL;
}

static void let_go(entry *it) { put_shared(&it->thread, NULL); }

/* Gives a state another owner. */
static void give(entry *it, entry *owner) {
    lock_table();
    unlink_from_owner(it);
    link_to(it, owner);
    unlock_table();
}

/* Ends the life of a handle whose entry is held, and lets it go. */
static void drop(entry *it) {
    lock_table();
    put_shared(&it->handle, NULL);
    unlink_from_owner(it);
    it->next = free_entries;
    free_entries = it;
    unlock_table();
    let_go(it);
}

/* The handle of some state of an instance; NULL: it has none. */
static void *state_of(const entry *owner) {
    lock_table();
    void *handle = owner->states == NULL ? NULL : get_shared(&owner->states->handle);
    unlock_table();
    return handle;
}
