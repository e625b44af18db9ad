/* bytes.h: memcpy() and memset() of the firmware, which calls no library. Copying a struct would call one. */
#ifndef BRICKPILOT_CORE_BYTES_H
#define BRICKPILOT_CORE_BYTES_H

#include <stdint.h>

#include "core/flash.h"

/* Copies `size` bytes, 1 or more. `to` and `from` do not overlap. */
void bytes_copy(void *to, const void *from, uint16_t size);

/* Copies `size` bytes from a table in flash. */
#ifdef __AVR__
void bytes_copy_flash(void *to, const FLASH void *from, uint16_t size);
#else
#define bytes_copy_flash bytes_copy
#endif

/* Sets `size` bytes, 1 or more, to 0. */
void bytes_clear(void *what, uint16_t size);

#endif
