#include "core/bytes.h"

void bytes_copy(void *to, const void *from, uint16_t size)
{
    uint8_t *at = (uint8_t *)to;
    const uint8_t *read = (const uint8_t *)from;
    do {
        *at++ = *read++;
    } while (--size > 0);
}

void bytes_clear(void *what, uint16_t size)
{
    uint8_t *at = (uint8_t *)what;
    do {
        *at++ = 0;
    } while (--size > 0);
}
