#include "vectors.h"

#ifdef __H8300__
int16_t h8sim_write(int16_t descriptor, const uint8_t *bytes, uint16_t size);
#define WRITE h8sim_write
#else
#include <unistd.h>
#define WRITE write
#endif

enum { STDOUT = 1, LINE_SIZE = 12, EDGES_16 = 48, EDGES_32 = 96 };

static uint16_t random_x = 1, random_y = 1;
static uint32_t edges[EDGES_32];
static const uint16_t masks[17] = {0, 1, 3, 7, 15, 31, 63, 127, 255, 511, 1023, 2047, 4095, 8191, 16383, 32767, 65535U};
static uint16_t crc_low = 0xFFFFU, crc_high = 0xFFFFU;
static uint16_t table_low[256], table_high[256];

/* xorshift on two words, 5 1 3: every pair but (0, 0) comes once in 2^32 - 1. */
uint16_t draw_u16(void)
{
    const uint16_t t = (uint16_t)(random_x ^ (uint16_t)(random_x << 5));
    random_x = random_y;
    random_y = (uint16_t)((random_y ^ (random_y >> 1)) ^ (t ^ (t >> 3)));
    return random_y;
}

bool draw_rarely(uint8_t bits)
{
    return (draw_u16() & masks[bits]) == 0;
}

/* An index below `count`, which is more than half of `mask` + 1. */
static uint8_t index_of(uint16_t bits, uint8_t mask, uint8_t count)
{
    const uint8_t index = (uint8_t)(bits & mask);
    return index < count ? index : (uint8_t)(index - count);
}

int16_t draw_s16(void)
{
    const uint16_t how = draw_u16();
    uint16_t value;

    if ((how & 3U) == 0)
        value = (uint16_t)edges[index_of(how >> 2, 63, EDGES_16)];
    else if ((how & 3U) == 1)
        return (int16_t)draw_u16();
    else
        value = draw_u16() & masks[(how >> 2) & 15U];
    return (int16_t)((how & 0x8000U) != 0 ? 0U - value : value);
}

int32_t draw_s32(void)
{
    const uint16_t how = draw_u16();
    uint32_t value;

    if ((how & 3U) == 0) {
        value = edges[index_of(how >> 2, 127, EDGES_32)];
    } else {
        value = (uint32_t)draw_u16() << 16;
        value |= draw_u16();
        if ((how & 3U) == 1)
            return (int32_t)value;
        if ((how & 4U) != 0)
            value &= 0xFFFFUL;
        value &= ((uint32_t)masks[(how >> 3) & 15U] << 16) | 0xFFFFU;
        if ((how & 4U) != 0)
            value &= masks[(how >> 7) & 15U];
    }
    return (int32_t)((how & 0x8000U) != 0 ? 0U - value : value);
}

uint16_t draw_up_to(uint16_t most)
{
    const uint16_t how = draw_u16();
    uint16_t mask = most, value;

    if ((how & 3U) == 0)
        return (how & 4U) != 0 ? most : 0;
    mask |= (uint16_t)(mask >> 1);
    mask |= (uint16_t)(mask >> 2);
    mask |= (uint16_t)(mask >> 4);
    mask |= (uint16_t)(mask >> 8);
    value = draw_u16() & mask;
    return value <= most ? value : (uint16_t)(value - most);
}

int16_t draw_between(int16_t low, int16_t high)
{
    return (int16_t)((uint16_t)low + draw_up_to((uint16_t)((uint16_t)high - (uint16_t)low)));
}

int32_t draw_within(int32_t limit)
{
    const int32_t drawn = draw_s32();
    uint32_t magnitude = drawn < 0 ? 0U - (uint32_t)drawn : (uint32_t)drawn;

    if (magnitude > (uint32_t)limit && (magnitude & 3U) == 0)
        magnitude = (uint32_t)limit;
    while (magnitude > (uint32_t)limit)
        magnitude >>= 1;
    return drawn < 0 ? -(int32_t)magnitude : (int32_t)magnitude;
}

void hash_u8(uint8_t value)
{
    const uint8_t at = (uint8_t)(crc_low ^ value);
    crc_low = (uint16_t)((crc_low >> 8) | (crc_high << 8)) ^ table_low[at];
    crc_high = (uint16_t)(crc_high >> 8) ^ table_high[at];
}

void hash_u16(uint16_t value)
{
    hash_u8((uint8_t)value);
    hash_u8((uint8_t)(value >> 8));
}

void hash_s16(int16_t value)
{
    hash_u16((uint16_t)value);
}

void hash_u32(uint32_t value)
{
    hash_u16((uint16_t)value);
    hash_u16((uint16_t)(value >> 16));
}

void hash_s32(int32_t value)
{
    hash_u32((uint32_t)value);
}

static void fill_tables(void)
{
    uint8_t at = 0;

    for (uint32_t power = 1; power != 0; power <<= 1) {
        edges[at++] = power - 1U;
        edges[at++] = power;
        edges[at++] = power + 1U;
    }
    for (uint16_t byte = 0; byte < 256; byte++) {
        uint32_t crc = byte;
        for (uint8_t bit = 0; bit < 8; bit++)
            crc = (crc & 1U) != 0 ? (crc >> 1) ^ 0xEDB88320UL : crc >> 1;
        table_low[byte] = (uint16_t)crc;
        table_high[byte] = (uint16_t)(crc >> 16);
    }
}

/* "12 0123abcd", the part and the hash so far. */
static bool tell(uint8_t part)
{
    static const char digits[] = "0123456789abcdef";
    uint32_t crc = ~(((uint32_t)crc_high << 16) | crc_low);
    uint8_t line[LINE_SIZE];

    line[0] = part < 10 ? ' ' : '1';
    line[1] = (uint8_t)digits[part < 10 ? part : part - 10];
    line[2] = ' ';
    for (uint8_t at = 10; at > 2; at--) {
        line[at] = (uint8_t)digits[crc & 15U];
        crc >>= 4;
    }
    line[LINE_SIZE - 1] = '\n';
    return WRITE(STDOUT, line, LINE_SIZE) == LINE_SIZE;
}

int main(void)
{
    bool told = true;

    fill_tables();
    for (uint8_t part = 1; part <= VECTORS_PARTS && told; part++) {
        for (uint16_t i = 0; i < VECTORS_OF_PART; i++)
            vectors_feed();
        told = tell(part);
    }
    return told ? 0 : 1;
}
