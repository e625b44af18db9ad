#include "avr/motors.h"

#include <avr/interrupt.h>
#include <stdbool.h>
#include <stdint.h>
#include <util/atomic.h>

#include "avr/pins.h"
#include "hal.h"

/* Fast PWM of 10 bits (mode 7): OCR = n makes the pin high for n + 1 of 1024 cycles. */
enum { PARTS = 1024, MODE_A = 1U << WGM11 | 1U << WGM10, MODE_B = 1U << WGM12 | 1U << CS10 };
enum { LEFT_ON_TIMER = 1U << COM1A1, RIGHT_ON_TIMER = 1U << COM1B1 };

typedef enum { COAST, BRAKE, FORWARD, BACKWARD } bridge_t;

/* The direction pins of both motors may share a port with other pins, also with pins that an interrupt writes. So this
 * function runs with interrupts off. */
static inline void set_pin(volatile uint8_t *port, uint8_t bit, bool on)
{
    *port = (uint8_t)(on ? *port | bit : *port & ~bit);
}

#define SET_PIN(on, ...) set_pin(&PINS_OUT(__VA_ARGS__), PINS_BIT(__VA_ARGS__), (on))

static void set_left(bridge_t bridge)
{
    if (bridge == FORWARD || bridge == BACKWARD) {
        TCCR1A |= LEFT_ON_TIMER;
    } else {
        TCCR1A &= (uint8_t)~LEFT_ON_TIMER;
        SET_PIN(bridge == BRAKE, BOARD_LEFT_PWM);
    }
    SET_PIN(bridge == FORWARD || bridge == BRAKE, BOARD_LEFT_IN1);
    SET_PIN(bridge == BACKWARD || bridge == BRAKE, BOARD_LEFT_IN2);
}

static void set_right(bridge_t bridge)
{
    if (bridge == FORWARD || bridge == BACKWARD) {
        TCCR1A |= RIGHT_ON_TIMER;
    } else {
        TCCR1A &= (uint8_t)~RIGHT_ON_TIMER;
        SET_PIN(bridge == BRAKE, BOARD_RIGHT_PWM);
    }
    SET_PIN(bridge == FORWARD || bridge == BRAKE, BOARD_RIGHT_IN1);
    SET_PIN(bridge == BACKWARD || bridge == BRAKE, BOARD_RIGHT_IN2);
}

void motors_coast(void)
{
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        set_left(COAST);
        set_right(COAST);
    }
}

#define MAKE_OUTPUT(...) (PINS_DIRECTION(__VA_ARGS__) |= PINS_BIT(__VA_ARGS__))

void motors_start(void)
{
    motors_coast();
    MAKE_OUTPUT(BOARD_LEFT_PWM);
    MAKE_OUTPUT(BOARD_LEFT_IN1);
    MAKE_OUTPUT(BOARD_LEFT_IN2);
    MAKE_OUTPUT(BOARD_RIGHT_PWM);
    MAKE_OUTPUT(BOARD_RIGHT_IN1);
    MAKE_OUTPUT(BOARD_RIGHT_IN2);
    TCCR1A = MODE_A;
    TCCR1B = MODE_B;
}

/* Returns the duty in parts of 1024, rounded to the nearest. */
static uint16_t parts_of(int16_t duty_q15)
{
    const uint16_t size = duty_q15 < 0 ? -(uint16_t)duty_q15 : (uint16_t)duty_q15;

    return (uint16_t)(size + 16U) >> 5;
}

static bridge_t bridge_of(int16_t duty_q15, uint16_t parts)
{
    if (parts == 0)
        return BRAKE;
    return duty_q15 > 0 ? FORWARD : BACKWARD;
}

void hal_motors_write(int16_t left_q15, int16_t right_q15)
{
    const uint16_t left = parts_of(left_q15), right = parts_of(right_q15);

    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        if (left > 0)
            OCR1A = left - 1U;
        if (right > 0)
            OCR1B = right - 1U;
        set_left(bridge_of(left_q15, left));
        set_right(bridge_of(right_q15, right));
    }
}
