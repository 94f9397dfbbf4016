/* Handles of live instances and states.
 *
 * The host gets numbers for instances and states, not addresses. A number is used once in the life
 * of a process, so that handles that are invalid, freed or from another FMU are recognised without
 * reading from an invalid address. (With pointers of 32 bits, numbers repeat after some thousand.)
 *
 * A call locks the entry of its instance, or state, from its beginning to its end. Entries are
 * never moved, so that they can be looked up while others are added and removed.
 */
#include <stdlib.h>

/* Defined by the runtime: lets other threads continue for a moment. */
static void give_way(void);

/* The lower bits of a handle are the index of its entry, the others a serial number. */
enum { PLACE_BITS = 20, CHUNK_BITS = 10 };

#define CHUNK_SIZE ((size_t)1 << CHUNK_BITS)
#define MOST_ENTRIES ((size_t)1 << PLACE_BITS)

typedef enum { INSTANCE, STATE } thing_kind;

struct entry {
    shared handle; /* NULL: free */
    shared thread; /* thread that has locked it; NULL: none */
    size_t place;
    thing_kind kind;
    void *thing;
    entry *owner, *states;  /* for a state; for an instance */
    entry *next, *previous; /* states of the same owner; free entries */
};

/* Most processes need only the first chunk. Index 0 is not used, so that no handle is NULL. */
static entry first_chunk[CHUNK_SIZE];
static shared chunks[MOST_ENTRIES >> CHUNK_BITS];

/* The thread that has locked the following variables and the links of entries; NULL: none. */
static shared table_thread;
static entry *free_entries;
static size_t n_entries;
static uint64_t serial;

static void lock_table(void) {
    while (!swap_shared(&table_thread, NULL, this_thread())) give_way();
}

static void unlock_table(void) { put_shared(&table_thread, NULL); }

/* Returns a different number for each address. */
static uint64_t mixed(uint64_t number) {
    number = (number ^ number >> 30) * 0xbf58476d1ce4e5b9u;
    number = (number ^ number >> 27) * 0x94d049bb133111ebu;
    return number ^ number >> 31;
}

/* Adds an unused entry. */
static int grow(void) {
    if (n_entries == 0) {
        /* Each FMU, and each copy of one in the process, begins with another number. */
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

/* Returns a new handle, or NULL if there is no memory. */
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

/* Locks and returns the entry of a handle; NULL, and an error message, if there is none or this
 * thread has locked it already. */
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

/* Returns the handle of a state of an instance, or NULL if there is no state. */
static void *state_of(const entry *owner) {
    lock_table();
    void *handle = owner->states == NULL ? NULL : get_shared(&owner->states->handle);
    unlock_table();
    return handle;
}
