/* vectors.h: what the vectors of every module have in common: numbers to feed it, and a hash over all that it gives back.
 *
 * One source is compiled for the host and for the RCX's processor; tests/gates/test_h8_vectors.py runs both and compares the
 * hashes. Numbers depend on nothing but how many were drawn before. Shifts and sums only: a vector must cost little on a
 * processor that multiplies 8 bits by 8, and may call no library.
 */
#ifndef BRICKPILOT_VECTORS_H
#define BRICKPILOT_VECTORS_H

#include <stdbool.h>
#include <stdint.h>

enum { VECTORS_PARTS = 16 }; /* a hash is told after each part */
#ifndef VECTORS_OF_PART
#define VECTORS_OF_PART 3125 /* 50,000 in all */
#endif

/* By the module: one vector. */
void vectors_feed(void);

/* Each draw stands in a statement of its own: the compilers do not agree on the order of arguments. Any value, all alike. */
uint16_t draw_u16(void);

/* True once in 2^bits, bits 0..16. */
bool draw_rarely(uint8_t bits);

/* Any value: a quarter of them edges (0, a power of two, one more or less, and the negatives of these), half of any magnitude. */
int16_t draw_s16(void);
int32_t draw_s32(void);

/* low..high, a quarter of them one of these two. */
int16_t draw_between(int16_t low, int16_t high);
uint16_t draw_up_to(uint16_t most);

/* As draw_s32(), within -limit..limit, both included; limit from 1. */
int32_t draw_within(int32_t limit);

/* CRC-32 (as zlib's) over bytes, low byte first: struct layouts differ between the machines, so field by field. */
void hash_u8(uint8_t value);
void hash_u16(uint16_t value);
void hash_s16(int16_t value);
void hash_u32(uint32_t value);
void hash_s32(int32_t value);

#endif
