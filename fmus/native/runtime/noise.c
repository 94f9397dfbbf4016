/* Python's random numbers: random.Random(seed).gauss(0.0, 1.0), bit for bit.
 *
 * The Mersenne Twister MT19937 of Matsumoto and Nishimura (https://doi.org/10.1145/272991.272995),
 * seeded as Python seeds it with an integer of one word.
 */
#ifndef NOISE_C
#define NOISE_C

#include <math.h>
#include <stdint.h>

enum { GENERATOR_WORDS = 624, SHIFT = 397, PAIR = 4 /* words of two normal numbers */ };

typedef uint32_t *word_places;

typedef struct {
    uint32_t place; /* index of the next word; GENERATOR_WORDS: all are used */
    int has_next;
    double next; /* normal numbers come in pairs */
    uint32_t words[GENERATOR_WORDS];
} generator;

static void seed_generator(generator *it, uint32_t seed) {
    word_places x = it->words;
    uint32_t i;
    x[0] = 19650218;
    for (i = 1; i < GENERATOR_WORDS; i++) x[i] = 1812433253 * (x[i - 1] ^ x[i - 1] >> 30) + i;
    for (i = 1; i < GENERATOR_WORDS; i++) {
        x[i] = (x[i] ^ (x[i - 1] ^ x[i - 1] >> 30) * 1664525) + seed;
    }
    x[0] = x[GENERATOR_WORDS - 1];
    x[1] = (x[1] ^ (x[0] ^ x[0] >> 30) * 1664525) + seed;
    for (i = 2; i < GENERATOR_WORDS; i++) {
        x[i] = (x[i] ^ (x[i - 1] ^ x[i - 1] >> 30) * 1566083941) - i;
    }
    x[0] = x[GENERATOR_WORDS - 1];
    x[1] = (x[1] ^ (x[0] ^ x[0] >> 30) * 1566083941) - 1;
    x[0] = 0x80000000;
    it->place = GENERATOR_WORDS;
    it->has_next = 0;
    it->next = 0.0;
}

static uint32_t twisted(uint32_t upper, uint32_t lower, uint32_t distant) {
    uint32_t both = (upper & 0x80000000) | (lower & 0x7fffffff);
    return distant ^ both >> 1 ^ (-(both & 1) & 0x9908b0df);
}

static void renew_words(word_places x) {
    const uint32_t n = GENERATOR_WORDS;
    uint32_t i;
    for (i = 0; i < n - SHIFT; i++) x[i] = twisted(x[i], x[i + 1], x[i + SHIFT]);
    for (; i < n - 1; i++) x[i] = twisted(x[i], x[i + 1], x[i + SHIFT - n]);
    x[i] = twisted(x[i], x[0], x[i + SHIFT - n]);
}

static uint32_t tempered(uint32_t x) {
    x ^= x >> 11;
    x ^= x << 7 & 0x9d2c5680;
    x ^= x << 15 & 0xefc60000;
    return x ^ x >> 18;
}

/* Returns a number uniform in [0, 1), with 53 bits from two words. */
static double uniform(word_places x) {
    uint32_t upper = tempered(x[0]) >> 5, lower = tempered(x[1]) >> 6;
    return (upper * 67108864.0 + lower) * (1.0 / 9007199254740992.0);
}

static double standard_normal(generator *it) {
    double z = it->next;
    if (it->has_next) {
        it->has_next = 0;
    } else {
        word_places words;
        double angle, radius;
        if (it->place > GENERATOR_WORDS - PAIR) {
            renew_words(it->words);
            it->place = 0;
        }
        words = it->words + it->place;
        it->place += PAIR;
        angle = uniform(words) * (2.0 * 3.141592653589793);
        radius = sqrt(-2.0 * log(1.0 - uniform(words + 2)));
        z = cos(angle) * radius;
        it->next = sin(angle) * radius;
        it->has_next = 1;
    }
    /* Python returns mean + z * deviation, which is never a negative zero. */
    return 0.0 + z;
}

#endif
