/* Numbers and texts as bytes, and back.
 *
 * All numbers are little-endian; Reals are IEEE 754 doubles, all others have four bytes. A text is
 * its length and its bytes.
 */
#include <string.h>

/* Writing */

/* Where bytes are written to; NULL: they are only counted. */
typedef struct {
    unsigned char *bytes;
    size_t size;
} writer;

static void put_bytes(writer *to, const void *bytes, size_t n) {
    if (to->bytes != NULL) memcpy(to->bytes + to->size, bytes, n);
    to->size += n;
}

static void put_word(writer *to, uint32_t word) {
    const unsigned char bytes[] = {(unsigned char)word, (unsigned char)(word >> 8),
                                   (unsigned char)(word >> 16), (unsigned char)(word >> 24)};
    put_bytes(to, bytes, sizeof bytes);
}

static void put_real(writer *to, double real) {
    uint64_t bits;
    memcpy(&bits, &real, sizeof bits);
    put_word(to, (uint32_t)bits);
    put_word(to, (uint32_t)(bits >> 32));
}

/* Numbers of one type. */
static void put_numbers(writer *to, fmi_type type, const double numbers[], size_t n) {
    for (size_t i = 0; i < n; i++) {
        if (type == REAL) {
            put_real(to, numbers[i]);
        } else {
            put_word(to, (uint32_t)(int32_t)numbers[i]);
        }
    }
}

/* Values of ports: Reals, and others. */
static void put_values(writer *to, const double values[], size_t reals, size_t n) {
    put_numbers(to, REAL, values, reals);
    put_numbers(to, INTEGER, values + reals, n - reals);
}

static void put_state(writer *to, const double values[]) {
    for (size_t i = 0; i < N_STATE_NUMBERS; values += state_numbers[i++].n) {
        put_numbers(to, state_numbers[i].type, values, state_numbers[i].n);
    }
}

static void put_text(writer *to, string text) {
    put_word(to, (uint32_t)strlen(text));
    put_bytes(to, text, strlen(text));
}

static uint32_t crc32(const unsigned char *bytes, size_t n) {
    /* Of the half bytes 0 to 15. */
    static const uint32_t sums[] = {
        0x00000000, 0x1db71064, 0x3b6e20c8, 0x26d930ac, 0x76dc4190, 0x6b6b51f4,
        0x4db26158, 0x5005713c, 0xedb88320, 0xf00f9344, 0xd6d6a3e8, 0xcb61b38c,
        0x9b64c2b0, 0x86d3d2d4, 0xa00ae278, 0xbdbdf21c,
    };
    uint32_t sum = 0xffffffff;
    for (size_t i = 0; i < n; i++) {
        sum ^= bytes[i];
        sum = sum >> 4 ^ sums[sum & 15];
        sum = sum >> 4 ^ sums[sum & 15];
    }
    return ~sum;
}

/* Reading */

typedef struct {
    const unsigned char *bytes;
    size_t left;
    int short_of; /* more was wanted than there is */
} reader;

/* The next bytes; NULL if there are not as many. */
static const unsigned char *take_bytes(reader *from, size_t n) {
    const unsigned char *bytes = from->bytes;
    from->short_of |= n > from->left;
    if (from->short_of) return NULL;
    from->bytes += n;
    from->left -= n;
    return bytes;
}

static uint32_t take_word(reader *from) {
    const unsigned char *b = take_bytes(from, 4);
    if (b == NULL) return 0;
    return b[0] | (uint32_t)b[1] << 8 | (uint32_t)b[2] << 16 | (uint32_t)b[3] << 24;
}

static double take_real(reader *from) {
    uint64_t lower = take_word(from), bits = lower | (uint64_t)take_word(from) << 32;
    double real;
    memcpy(&real, &bits, sizeof real);
    return real;
}

static void take_numbers(reader *from, fmi_type type, double numbers[], size_t n) {
    for (size_t i = 0; i < n; i++) {
        numbers[i] = type == REAL ? take_real(from) : (int32_t)take_word(from);
    }
}

static void take_values(reader *from, double values[], size_t reals, size_t n) {
    take_numbers(from, REAL, values, reals);
    take_numbers(from, INTEGER, values + reals, n - reals);
}

/* A text that messages have room for, without a zero in it. */
static int take_text(reader *from, char text[MOST_TEXT + 1]) {
    uint32_t length = take_word(from);
    const unsigned char *bytes = length <= MOST_TEXT ? take_bytes(from, length) : NULL;
    if (bytes == NULL) return 0;
    memcpy(text, bytes, length);
    text[length] = '\0';
    return strlen(text) == length && is_utf8(text);
}

/* Whether the next is a text. */
static int take_this(reader *from, string text) {
    char found[MOST_TEXT + 1];
    return take_text(from, found) && strcmp(found, text) == 0;
}

/* A saved truth value; -1 if it is neither. */
static int take_truth(reader *from) {
    uint32_t word = take_word(from);
    return word <= 1 ? (int)word : -1;
}
