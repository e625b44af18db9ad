#include "core/bytes.h"

void bytes_copy(void *to, const void *from, uint16_t size)
{
    uint8_t *at = (uint8_t *)to;
    const uint8_t *read = (const uint8_t *)from;
    do {
        *at++ = *read++;
    } while (--size > 0);
}

#ifdef __AVR__
void bytes_copy_flash(void *to, const FLASH void *from, uint16_t size)
{
    uint8_t *at = (uint8_t *)to;
    const FLASH uint8_t *read = (const FLASH uint8_t *)from;
    do {
        *at++ = *read++;
    } while (--size > 0);
}
#endif

void bytes_clear(void *what, uint16_t size)
{
    uint8_t *at = (uint8_t *)what;
    do {
        *at++ = 0;
    } while (--size > 0);
}
