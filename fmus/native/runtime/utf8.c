/* Which bytes are text. */

/* The character that a text begins with, and its number of bytes; 0 if it is none. */
static int character_of(const char *text, uint32_t *character) {
    static const uint32_t smallest[] = {0, 0, 0x80, 0x800, 0x10000};
    const unsigned char *bytes = (const unsigned char *)text;
    int length = bytes[0] < 0x80      ? 1
                 : bytes[0] >> 5 == 6  ? 2
                 : bytes[0] >> 4 == 14 ? 3
                 : bytes[0] >> 3 == 30 ? 4
                                       : 0;
    *character = bytes[0];
    if (length < 2) return length;
    *character &= 0x7f >> length;
    for (int i = 1; i < length; i++) {
        if (bytes[i] >> 6 != 2) return 0;
        *character = *character << 6 | (bytes[i] & 0x3f);
    }
    int surrogate = *character >= 0xd800 && *character <= 0xdfff;
    return *character < smallest[length] || surrogate || *character > 0x10ffff ? 0 : length;
}

static int is_utf8(const char *text) {
    uint32_t character;
    while (*text != '\0') {
        int length = character_of(text, &character);
        if (length == 0) return 0;
        text += length;
    }
    return 1;
}
