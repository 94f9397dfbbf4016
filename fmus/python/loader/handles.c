/* Tells what is alive from what is not.
 *
 * The host gets numbers for instances and states, no addresses: a number is given once in the life
 * of a process, so that what was freed, what belongs to another FMU, and what is none are told from
 * what is alive, without looking where a wrong address points to.
 */
#include <stdlib.h>

/* The lower bits of a handle are its place in the table, the others the serial number. */
enum { PLACE_BITS = 24, FIRST_SIZE = 64 };

typedef struct {
    uintptr_t handle;
    kind kind;
    void *thing, *owner;
    size_t next_free;
} entry;

/* Place 0 holds nothing, but is where the list of free places begins and ends. */
static entry *table;
static size_t size;

static entry *find(void *handle, kind kind) {
    size_t place = (uintptr_t)handle & (((uintptr_t)1 << PLACE_BITS) - 1);
    entry *found = place < size ? &table[place] : NULL;
    int alive = found != NULL && found->handle == (uintptr_t)handle && found->kind == kind;
    return alive ? found : NULL;
}

static int grow(void) {
    size_t more = size == 0 ? FIRST_SIZE : 2 * size;
    entry *grown = more >> PLACE_BITS == 0 ? realloc(table, more * sizeof *table) : NULL;
    if (grown == NULL) return 0;
    table = grown;
    for (size_t place = size; place < more; place++) {
        table[place] = (entry){.kind = FREE, .next_free = place + 1 < more ? place + 1 : 0};
    }
    table[0].next_free = size == 0 ? 1 : size;
    size = more;
    return 1;
}

/* NULL if there is no memory for another one. */
void *new_handle(kind kind, void *thing, void *owner) {
    if ((size == 0 || table[0].next_free == 0) && !grow()) return NULL;
    size_t place = table[0].next_free;
    table[0].next_free = table[place].next_free;
    uintptr_t handle = (uintptr_t)next_serial() << PLACE_BITS | place;
    table[place] = (entry){.handle = handle, .kind = kind, .thing = thing, .owner = owner};
    return (void *)handle;
}

/* What a handle stands for; NULL if it is not alive. */
void *thing_of(void *handle, kind kind) {
    entry *found = find(handle, kind);
    return found == NULL ? NULL : found->thing;
}

/* Gives a state's handle another state and owner. */
void replace(void *handle, void *thing, void *owner) {
    entry *found = find(handle, STATE);
    found->thing = thing;
    found->owner = owner;
}

void drop(void *handle) {
    size_t place = (uintptr_t)handle & (((uintptr_t)1 << PLACE_BITS) - 1);
    table[place] = (entry){.kind = FREE, .next_free = table[0].next_free};
    table[0].next_free = place;
}

/* Some state of an instance; NULL: it has none. */
void *state_of(void *owner) {
    for (size_t place = 1; place < size; place++) {
        if (table[place].kind == STATE && table[place].owner == owner) {
            return (void *)table[place].handle;
        }
    }
    return NULL;
}
