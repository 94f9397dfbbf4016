/* Tells what is alive from what is not.
 *
 * The host gets numbers for instances and states, no addresses: a number is given once in the life
 * of a process, so that what was freed, what belongs to another FMU, and what is none are told from
 * what is alive, without looking where a wrong address points to. (Where a pointer has 32 bits, a
 * number comes again after some thousand.)
 *
 * A call locks the entry of its instance, or state, from its beginning to its end. Entries stay
 * where they are, so that they can be looked up while others come and go.
 */
#include <stdlib.h>

/* Of the runtime: lets other threads go on for a moment. */
static void give_way(void);

/* The lower bits of a handle are its place among the entries, the others the serial number. */
enum { PLACE_BITS = 20, CHUNK_BITS = 10 };

#define CHUNK_SIZE ((size_t)1 << CHUNK_BITS)
#define MOST_ENTRIES ((size_t)1 << PLACE_BITS)

typedef enum { INSTANCE, STATE } thing_kind;

struct entry {
    shared handle; /* NULL: free */
    shared thread; /* that has locked it; NULL: none */
    size_t place;
    thing_kind kind;
    void *thing;
    entry *owner, *states;  /* of a state; of an instance */
    entry *next, *previous; /* states of the same owner; free entries */
};

/* Most processes need no more than the first chunk. Place 0 holds nothing: no handle is NULL. */
static entry first_chunk[CHUNK_SIZE];
static shared chunks[MOST_ENTRIES >> CHUNK_BITS];

/* The thread that changes what follows, and the links of entries; NULL: none. */
static shared table_thread;
static entry *free_entries;
static size_t n_entries;
static uint64_t serial;

static void lock_table(void) {
    while (!swap_shared(&table_thread, NULL, this_thread())) give_way();
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

static void unlock_entry(entry *it) { put_shared(&it->thread, NULL); }

/* The entry of a handle, which no other thread has locked; NULL, and what is wrong: there is none,
 * or this thread is in a call of it already. */
static entry *lock_entry(void *handle, thing_kind kind, string *wrong) {
    size_t place = (uintptr_t)handle & (MOST_ENTRIES - 1);
    entry *chunk = get_shared(&chunks[place >> CHUNK_BITS]);
    entry *it = chunk == NULL ? NULL : &chunk[place & (CHUNK_SIZE - 1)];
    *wrong = kind == INSTANCE ? "not a live instance of this FMU" : "not a live state of this FMU";
    while (is_alive(it, handle)) {
        if (swap_shared(&it->thread, NULL, this_thread())) {
            if (is_alive(it, handle) && it->kind == kind) return it;
            unlock_entry(it);
            return NULL;
        }
        if (get_shared(&it->thread) == this_thread()) {
            if (kind == INSTANCE) *wrong = "called by the logger";
            return NULL;
        }
        give_way();
    }
    return NULL;
}

static void set_owner(entry *it, entry *owner) {
    lock_table();
    unlink_from_owner(it);
    link_to(it, owner);
    unlock_table();
}

/* Ends the life of a handle, and unlocks its entry. */
static void free_entry(entry *it) {
    lock_table();
    put_shared(&it->handle, NULL);
    unlink_from_owner(it);
    it->next = free_entries;
    free_entries = it;
    unlock_table();
    unlock_entry(it);
}

/* The handle of some state of an instance; NULL: it has none. */
static void *state_of(const entry *owner) {
    lock_table();
    void *handle = owner->states == NULL ? NULL : get_shared(&owner->states->handle);
    unlock_table();
    return handle;
}
