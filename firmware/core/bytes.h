/* bytes.h: what memcpy and memset are for, without calling the library. */
#ifndef BRICKPILOT_CORE_BYTES_H
#define BRICKPILOT_CORE_BYTES_H

#include <stdint.h>

static inline void bytes_copy(void *to, const void *from, uint16_t size)
{
    uint8_t *at = (uint8_t *)to;
    const uint8_t *read = (const uint8_t *)from;
    while (size-- > 0)
        *at++ = *read++;
}

static inline void bytes_clear(void *what, uint16_t size)
{
    uint8_t *at = (uint8_t *)what;
    while (size-- > 0)
        *at++ = 0;
}

#endif
