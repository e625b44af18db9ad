/* h8sim_on_host.c: what firmware/targets/h8sim/main.c needs from start.s, for this machine: the same program, by its own compiler. */
#include <stdint.h>
#include <unistd.h>

int16_t h8sim_read(int16_t descriptor, uint8_t *bytes, uint16_t size);
int16_t h8sim_write(int16_t descriptor, const uint8_t *bytes, uint16_t size);

int16_t h8sim_read(int16_t descriptor, uint8_t *bytes, uint16_t size)
{
    return (int16_t)read(descriptor, bytes, size);
}

int16_t h8sim_write(int16_t descriptor, const uint8_t *bytes, uint16_t size)
{
    return (int16_t)write(descriptor, bytes, size);
}
