/* Rows of numbers as text: for each double the shortest decimal number that reads back as the same double, the
   nearest to it among those (R. Giulietti, "The Schubfach way to render doubles", 2020), in the notation of
   orjson. */

#include <stdint.h>
#include <string.h>

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef unsigned __int128 Wide;
typedef struct {
    uint64_t high, low;
} Power;

/* 10**k for k from SMALLEST on, as 128 bits of which the first is 1, rounded up; from cosim/compiled/powers.py. */
#include "powers.h"

#define LONGEST 25 /* characters of a number and what follows it */

/* Decimal digits and exponent of a double. */
typedef struct {
    uint64_t digits;
    int exponent;
} Decimal;

/* Product with a power of ten without its last 128 bits; whether they were more than rounding is in bit 0. */
static inline uint64_t product(const Power *power, uint64_t factor) {
    const uint64_t carry = (uint64_t)(((Wide)power->low * factor) >> 64);
    const Wide whole = (Wide)power->high * factor + carry;
    return (uint64_t)(whole >> 64) | ((uint64_t)whole > 1);
}

static inline Decimal shortest(uint64_t fraction, int biased) {
    const int is_normal = biased != 0;
    const uint64_t c = is_normal ? fraction | (UINT64_C(1) << 52) : fraction;
    const int q = (is_normal ? biased : 1) - 1075;
    /* Below a power of two the next double is half as far away. */
    const int is_uneven = fraction == 0 && biased > 1;
    const uint64_t odd = c & 1;
    const int k = (int)(((int64_t)q * 1262611 - (is_uneven ? 524031 : 0)) >> 22); /* floor(log10(..)) */
    const int h = q + (int)(((int64_t)-k * 1741647) >> 19) + 1;
    const Power *power = powers - k - SMALLEST;
    const uint64_t low = product(power, (4 * c - 2 + (uint64_t)is_uneven) << h) + odd;
    const uint64_t middle = product(power, (4 * c) << h);
    const uint64_t high = product(power, (4 * c + 2) << h) - odd;
    const uint64_t s = middle / 4;
    int below, above;
    Decimal found;
    if (s >= 10) {
        const uint64_t tens = s / 10;
        below = low <= 40 * tens;
        above = 40 * tens + 40 <= high;
        if (below != above) {
            found.digits = tens + (uint64_t)above;
            found.exponent = k + 1;
            return found;
        }
    }
    below = low <= 4 * s;
    above = 4 * s + 4 <= high;
    found.exponent = k;
    if (below != above)
        found.digits = s + (uint64_t)above;
    else
        found.digits = s + (middle > 4 * s + 2 || (middle == 4 * s + 2 && (s & 1)));
    return found;
}

/* Eight digits of a number below 10**8, the first one in the lowest byte: halves, quarters and digits side by side
   in one word. */
static inline uint64_t eight_digits(uint32_t number) {
    const uint64_t halves = number / 10000 | (uint64_t)(number % 10000) << 32;
    const uint64_t hundreds = (halves * 10486 >> 20) & UINT64_C(0x0000007f0000007f);
    const uint64_t quarters = hundreds | (halves - 100 * hundreds) << 16;
    const uint64_t tens = (quarters * 103 >> 10) & UINT64_C(0x000f000f000f000f);
    return (tens | (quarters - 10 * tens) << 8) + UINT64_C(0x3030303030303030);
}

/* The digits of a number below 10**17 as 24 characters, zeros in front. */
static inline void write_digits(char *out, uint64_t number) {
    const uint64_t upper = number / 100000000, parts[] = {
        eight_digits((uint32_t)(upper / 100000000)), eight_digits((uint32_t)(upper % 100000000)),
        eight_digits((uint32_t)(number % 100000000))};
    memcpy(out, parts, 24);
}

/* Text of a double; returns its length, at most LONGEST - 1. */
static int write_number(char *out, uint64_t bits) {
    const uint64_t fraction = bits & ((UINT64_C(1) << 52) - 1);
    const int biased = (int)(bits >> 52) & 0x7ff;
    char *begin = out;
    char written[24], *digits = written;
    Decimal number;
    int count, point;
    if (biased == 0x7ff && fraction) {
        memcpy(out, "nan", 3);
        return 3;
    }
    if (bits >> 63) *out++ = '-';
    if (biased == 0x7ff || !(bits << 1)) {
        memcpy(out, biased ? "inf" : "0.0", 3);
        return (int)(out - begin) + 3;
    }
    number = shortest(fraction, biased);
    write_digits(written, number.digits);
    while (*digits == '0') digits++;
    count = (int)(written + 24 - digits);
    while (digits[count - 1] == '0') count--, number.exponent++;
    point = count + number.exponent; /* digits before the point */
    if (number.exponent >= 0 && point <= 16) { /* 1200.0 */
        memcpy(out, digits, (size_t)count);
        memset(out + count, '0', (size_t)number.exponent);
        out += point;
        *out++ = '.', *out++ = '0';
    } else if (point > 0 && point <= 16) { /* 1.2 */
        memcpy(out, digits, (size_t)point);
        out[point] = '.';
        memcpy(out + point + 1, digits + point, (size_t)(count - point));
        out += count + 1;
    } else if (point > -5 && point <= 0) { /* 0.0012 */
        *out++ = '0', *out++ = '.';
        memset(out, '0', (size_t)-point);
        memcpy(out - point, digits, (size_t)count);
        out += count - point;
    } else { /* 1.2e-7, 1e+16 */
        int exponent = point - 1;
        *out++ = digits[0];
        if (count > 1) {
            *out++ = '.';
            memcpy(out, digits + 1, (size_t)(count - 1));
            out += count - 1;
        }
        *out++ = 'e';
        *out++ = exponent < 0 ? '-' : '+';
        if (exponent < 0) exponent = -exponent;
        if (exponent >= 100) *out++ = (char)('0' + exponent / 100);
        if (exponent >= 10) *out++ = (char)('0' + exponent / 10 % 10);
        *out++ = (char)('0' + exponent % 10);
    }
    return (int)(out - begin);
}

/* Values recur: a connected input is an output, a reference stays. Chosen: as large as the fast cache is good for. */
#define KEPT_BITS 9
typedef struct {
    uint64_t bits;
    int32_t length; /* 0: nothing yet */
    char text[28];
} Kept;

/* Rows of a table as lines of CSV, each its time and the values of some columns.

   times, table: first time and first row; next_time, next_row: how many numbers further the next one is; slots: the
   columns; out: room for LONGEST characters a number; ends: behind each line, its end included. */
EXPORT void format_rows(const double *times, int64_t next_time, const double *table, int64_t next_row, int64_t rows,
                        const int64_t *slots, int64_t columns, char *out, int64_t *ends) {
    Kept kept[1 << KEPT_BITS];
    char *next = out;
    int64_t i, j;
    for (i = 0; i < 1 << KEPT_BITS; i++) kept[i].length = 0;
    for (i = 0; i < rows; i++) {
        for (j = -1; j < columns; j++) {
            Kept *place;
            uint64_t bits;
            memcpy(&bits, j < 0 ? times : table + slots[j], sizeof bits);
            place = kept + ((bits * UINT64_C(0x9E3779B97F4A7C15)) >> (64 - KEPT_BITS));
            if (!place->length || place->bits != bits) {
                place->bits = bits;
                place->length = write_number(place->text, bits);
            }
            memcpy(next, place->text, LONGEST - 1);
            next += place->length;
            *next++ = ',';
        }
        next[-1] = '\n';
        ends[i] = next - out;
        times += next_time;
        table += next_row;
    }
}
