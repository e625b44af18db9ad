/* h8sim_on_host.c: stands in for start.s, so that firmware/targets/h8sim/main.c runs on this machine too. */
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
