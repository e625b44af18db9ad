/* unistd.h: what tests/vectors needs of it, on an AVR chip; console.c has it. */
#ifndef BRICKPILOT_TESTS_AVR_UNISTD_H
#define BRICKPILOT_TESTS_AVR_UNISTD_H

#include <stddef.h>

/* Sends `size` bytes on UART 0 and returns `size`. */
int write(int descriptor, const void *bytes, size_t size);

#endif
