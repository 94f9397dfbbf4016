/* What C99 lacks: words that threads share, threads, functions that a library offers. */
#ifndef PLATFORM_H
#define PLATFORM_H

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
/* Before any header: what strict C99 hides of POSIX. */
#ifndef _POSIX_C_SOURCE
#define _POSIX_C_SOURCE 200809L
#endif
#include <pthread.h>
#include <time.h>
#define EXPORT __attribute__((visibility("default")))
#endif

/* The name of a function: where a prefix for it is defined, as the standards have it, several FMUs
 * can be linked into one program. */
#define PASTE(prefix, name) prefix##name
#define PREFIXED(prefix, name) PASTE(prefix, name)

#if defined(_MSC_VER)
#include <intrin.h>
#endif

#include <stddef.h>
#include <stdint.h>

/* A word that several threads read and write. What a thread wrote before it put a word is seen by
 * one that got it. */
typedef void *volatile shared;

#if defined(_MSC_VER)

static inline void *get_shared(shared *word) {
    return _InterlockedCompareExchangePointer(word, NULL, NULL);
}

static inline void put_shared(shared *word, void *value) {
    (void)_InterlockedExchangePointer(word, value);
}

/* Whether the word was `before`, and is `after` now. */
static inline int swap_shared(shared *word, void *before, void *after) {
    return _InterlockedCompareExchangePointer(word, after, before) == before;
}

#else

static inline void *get_shared(shared *word) { return __atomic_load_n(word, __ATOMIC_ACQUIRE); }

static inline void put_shared(shared *word, void *value) {
    __atomic_store_n(word, value, __ATOMIC_RELEASE);
}

/* Whether the word was `before`, and is `after` now. */
static inline int swap_shared(shared *word, void *before, void *after) {
    return __atomic_compare_exchange_n(word, &before, after, 0, __ATOMIC_ACQUIRE,
                                       __ATOMIC_RELAXED);
}

#endif

#if defined(_WIN32)

/* windows.h would bring thousands of names. */
__declspec(dllimport) unsigned long __stdcall GetCurrentThreadId(void);
__declspec(dllimport) void __stdcall Sleep(unsigned long milliseconds);

/* What tells this thread from the others; never NULL. */
static inline void *this_thread(void) { return (void *)(uintptr_t)GetCurrentThreadId(); }

static inline void wait_a_moment(void) { Sleep(1); }

#else

/* What tells this thread from the others; never NULL. */
static inline void *this_thread(void) { return (void *)pthread_self(); }

/* It sleeps: a thread of high priority that only yields would never let the other one finish. */
static inline void wait_a_moment(void) {
    static const struct timespec moment = {0, 20000};
    nanosleep(&moment, NULL);
}

#endif

#endif
