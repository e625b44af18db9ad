/* system.h: the two system calls of the H8/300 simulator, in start.s.
 *
 * Each returns the number of bytes that it moved, 0 at the end of the file, and a negative number after an error.
 */
#ifndef BRICKPILOT_H8SIM_SYSTEM_H
#define BRICKPILOT_H8SIM_SYSTEM_H

#include <stdint.h>

int16_t h8sim_read(int16_t descriptor, uint8_t *bytes, uint16_t size);
int16_t h8sim_write(int16_t descriptor, const uint8_t *bytes, uint16_t size);

#endif
