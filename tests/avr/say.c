/* say.c: the output of a test program on an AVR chip, for tests/rcx/unity.c and tests/avr/world.c. */
#include <avr/io.h>
#include <stdlib.h>

#include "../rcx/world.h"

void world_say(const char *text)
{
    while (*text != '\0')
        GPIOR2 = (uint8_t)*text++;
}

void world_say_number(uint16_t number)
{
    if (number >= 10)
        world_say_number(number / 10);
    GPIOR2 = (uint8_t)('0' + number % 10);
}

void world_exit(int16_t status)
{
    exit(status);
}
