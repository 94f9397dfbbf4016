/* Features that C99 lacks: atomic words, threads, exported functions. */
#ifndef PLATFORM_H
#define PLATFORM_H

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
/* Before any header: POSIX functions that strict C99 hides. */
#ifndef _POSIX_C_SOURCE
#define _POSIX_C_SOURCE 200809L
#endif
#include <pthread.h>
#include <time.h>
#define EXPORT __attribute__((visibility("default")))
#endif

/* The name of a function; with prefixes, as in the standards, several FMUs can be linked into one
 * program. */
#define PASTE(prefix, name) prefix##name
#define PREFIXED(prefix, name) PASTE(prefix, name)

#if defined(_MSC_VER)
#include <intrin.h>
#endif

#include <stddef.h>
#include <stdint.h>

/* A word that several threads read and write, with release and acquire semantics. */
typedef void *volatile shared;

#if defined(_MSC_VER)

static inline void *get_shared(shared *word) {
    return _InterlockedCompareExchangePointer(word, NULL, NULL);
}

static inline void put_shared(shared *word, void *value) {
    (void)_InterlockedExchangePointer(word, value);
}

/* Changes the word from `before` to `after`; false if it was not `before`. */
static inline int swap_shared(shared *word, void *before, void *after) {
    return _InterlockedCompareExchangePointer(word, after, before) == before;
}

#else

static inline void *get_shared(shared *word) { return __atomic_load_n(word, __ATOMIC_ACQUIRE); }

static inline void put_shared(shared *word, void *value) {
    __atomic_store_n(word, value, __ATOMIC_RELEASE);
}

/* Changes the word from `before` to `after`; false if it was not `before`. */
static inline int swap_shared(shared *word, void *before, void *after) {
    return __atomic_compare_exchange_n(word, &before, after, 0, __ATOMIC_ACQUIRE,
                                       __ATOMIC_RELAXED);
}

#endif

#if defined(_WIN32)

/* windows.h would define thousands of names. */
__declspec(dllimport) unsigned long __stdcall GetCurrentThreadId(void);
__declspec(dllimport) void __stdcall Sleep(unsigned long milliseconds);

/* Identifies this thread; never NULL. */
static inline void *this_thread(void) { return (void *)(uintptr_t)GetCurrentThreadId(); }

static inline void wait_a_moment(void) { Sleep(1); }

#else

/* Identifies this thread; never NULL. */
static inline void *this_thread(void) { return (void *)pthread_self(); }

/* Sleeps: a thread of high priority that only yields would never let another one finish. */
static inline void wait_a_moment(void) {
    static const struct timespec moment = {0, 20000};
    nanosleep(&moment, NULL);
}

#endif

#endif
