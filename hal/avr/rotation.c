#include "avr/rotation.h"

#include <avr/interrupt.h>
#include <util/atomic.h>

#include "avr/pins.h"
#include "hal.h"

#ifdef AVR_ROTATION
enum {
    LEFT_A = PINS_BIT(BOARD_LEFT_A),
    LEFT_B = PINS_BIT(BOARD_LEFT_B),
    RIGHT_A = PINS_BIT(BOARD_RIGHT_A),
    RIGHT_B = PINS_BIT(BOARD_RIGHT_B),
    ALL = LEFT_A | LEFT_B | RIGHT_A | RIGHT_B,
    ERROR = 2
};

/* The count of a change. Index: old A * 8 + old B * 4 + new A * 2 + new B. Forward, A leads: 00, 10, 11, 01. */
static const __flash int8_t STEPS[16] = {0, -1, 1, ERROR, 1, 0, ERROR, -1, -1, ERROR, 0, 1, ERROR, 1, -1, 0};

static volatile uint16_t left, right, errors;
static uint8_t left_was, right_was;

static inline uint8_t state(uint8_t pins, uint8_t a, uint8_t b)
{
    return (uint8_t)((pins & a ? 2U : 0U) | (pins & b ? 1U : 0U));
}

static inline void take(volatile uint16_t *count, uint8_t *was, uint8_t is)
{
    const int8_t step = STEPS[*was << 2 | is];

    *was = is;
    if (step != ERROR)
        *count += (uint16_t)step;
    else if (errors < 65535U)
        errors++;
}

ISR(PCINT2_vect)
{
    const uint8_t pins = PINS_IN(BOARD_LEFT_A); /* read once, so that all four levels are from the same time */

    take(&left, &left_was, state(pins, LEFT_A, LEFT_B));
    take(&right, &right_was, state(pins, RIGHT_A, RIGHT_B));
}

void rotation_start(void)
{
    uint8_t pins;

    PINS_DIRECTION(BOARD_LEFT_A) &= (uint8_t)~ALL;
    PINS_OUT(BOARD_LEFT_A) |= ALL;
    PCMSK2 = ALL;
    PCIFR = 1U << PCIF2;
    PCICR |= 1U << PCIE2;
    pins = PINS_IN(BOARD_LEFT_A);
    left_was = state(pins, LEFT_A, LEFT_B);
    right_was = state(pins, RIGHT_A, RIGHT_B);
}

uint16_t rotation_errors(void)
{
    uint16_t counted;

    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        counted = errors;
    }
    return counted;
}

hal_status_t hal_rotation_read(hal_rotation_t *out)
{
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        out->left = BOARD_LEFT_REVERSED ? -left : left;
        out->right = BOARD_RIGHT_REVERSED ? -right : right;
    }
    return HAL_OK;
}
#else
void rotation_start(void) {}

uint16_t rotation_errors(void)
{
    return 0;
}

hal_status_t hal_rotation_read(hal_rotation_t *out)
{
    (void)out;
    return HAL_ABSENT;
}
#endif
