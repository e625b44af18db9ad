/* main.c: gives each record of a flight to control_law(), and writes its four answers and, on an AVR chip, the cycles that it took: five
 * numbers of 32 bits, the lowest byte first. On the RCX the simulator's trace has what a step takes.
 */
#include "core/bytes.h"
#include "law.h"
#include "records.inc"

#ifdef __H8300__
int16_t h8sim_write(int16_t descriptor, const uint8_t *bytes, uint16_t size);
#define WRITE h8sim_write
#else
#include <unistd.h>
#define WRITE write
#endif

enum { STDOUT = 1, NUMBERS = 5, BYTES = 4 * NUMBERS };

#ifdef __AVR__
#include <avr/io.h>

/* Timer 1 counts cycles, and laps once at most. */
static uint32_t timed(const input_t *input, answer_t *answer)
{
    uint16_t cycles;

    TCCR1B = 0;
    TCNT1 = 0;
    TIFR1 = 1U << TOV1;
    TCCR1B = 1U << CS10;
    control_law(input, answer);
    cycles = TCNT1;
    return cycles | ((TIFR1 & 1U << TOV1) != 0 ? 0x10000UL : 0);
}
#else
static uint32_t timed(const input_t *input, answer_t *answer)
{
    control_law(input, answer);
    return 0;
}
#endif

static void put(uint8_t *bytes, uint32_t number)
{
    const uint16_t low = (uint16_t)number, high = (uint16_t)(number >> 16);

    bytes[0] = (uint8_t)low;
    bytes[1] = (uint8_t)(low >> 8);
    bytes[2] = (uint8_t)high;
    bytes[3] = (uint8_t)(high >> 8);
}

static uint32_t bits_of(num value)
{
    uint32_t bits;

    bytes_copy(&bits, &value, sizeof bits);
    return bits;
}

int main(void)
{
    static input_t input;
    static answer_t answer;
    static uint8_t bytes[BYTES];
    int16_t written = BYTES;

    control_begin();
    for (const FLASH input_t *at = RECORDS; at < RECORDS + sizeof RECORDS / sizeof *RECORDS && written == BYTES; at++) {
        bytes_copy_flash(&input, at, sizeof input);
        put(bytes + 16, timed(&input, &answer));
        put(bytes, bits_of(answer.left));
        put(bytes + 4, bits_of(answer.right));
        put(bytes + 8, bits_of(answer.left_duty));
        put(bytes + 12, bits_of(answer.right_duty));
        written = (int16_t)WRITE(STDOUT, bytes, BYTES);
    }
    return written == BYTES ? 0 : 1;
}
