/* memory.c: two functions that the compiler calls to copy and clear structs. The simulator has no library. */
#include <stdint.h>

void *memcpy(void *to, const void *from, uint16_t size);
void *memset(void *what, int value, uint16_t size);

void *memcpy(void *to, const void *from, uint16_t size)
{
    uint8_t *at = (uint8_t *)to;
    const uint8_t *read = (const uint8_t *)from;
    while (size-- > 0)
        *at++ = *read++;
    return to;
}

void *memset(void *what, int value, uint16_t size)
{
    uint8_t *at = (uint8_t *)what;
    while (size-- > 0)
        *at++ = (uint8_t)value;
    return what;
}
