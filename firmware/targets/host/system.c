/* system.c: the two system calls of targets/h8sim/main.c for the host, so that the same program runs there, too. */
#include <unistd.h>

#include "h8sim/system.h"

int16_t h8sim_read(int16_t descriptor, uint8_t *bytes, uint16_t size)
{
    return (int16_t)read(descriptor, bytes, size);
}

int16_t h8sim_write(int16_t descriptor, const uint8_t *bytes, uint16_t size)
{
    return (int16_t)write(descriptor, bytes, size);
}
