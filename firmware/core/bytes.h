/* bytes.h: memcpy() and memset() of the firmware, which calls no library. The compiler would call it to copy a struct. */
#ifndef BRICKPILOT_CORE_BYTES_H
#define BRICKPILOT_CORE_BYTES_H

#include <stdint.h>

/* Copies `size` bytes, 1 or more. `to` and `from` do not overlap. */
void bytes_copy(void *to, const void *from, uint16_t size);

/* Sets `size` bytes, 1 or more, to 0. */
void bytes_clear(void *what, uint16_t size);

#endif
