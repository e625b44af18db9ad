/* wiring_of_board.h: makes a wiring_t from hal/avr/board.h. A file for each chip includes it and names the chip. */
#include "avr/board.h"
#include "avr/wiring.h"

enum { PORT_A = 'A', PORT_B, PORT_C, PORT_D, PORT_E, PORT_F, PORT_G, PORT_H, PORT_J = 'J', PORT_K, PORT_L };

#define PAIR(port, bit)                                                                                                \
    {                                                                                                                  \
        PORT_##port, bit                                                                                               \
    }
#define PIN(...) PAIR(__VA_ARGS__)
#define PER_COUNT(name) ((BOARD_##name##_REVERSED ? -1e-3 : 1e-3) * BOARD_##name##_PER_COUNT_Q8 / 256)
#define ANALOG(name)                                                                                                   \
    {                                                                                                                  \
        BOARD_##name##_INPUT, BOARD_##name##_ZERO, PER_COUNT(name)                                                     \
    }

#define WIRING_OF_BOARD                                                                                                \
    .motor = {{PIN(BOARD_LEFT_PWM), PIN(BOARD_LEFT_IN1), PIN(BOARD_LEFT_IN2)},                                         \
              {PIN(BOARD_RIGHT_PWM), PIN(BOARD_RIGHT_IN1), PIN(BOARD_RIGHT_IN2)}},                                     \
    .encoder = {{PIN(BOARD_LEFT_A), PIN(BOARD_LEFT_B)}, {PIN(BOARD_RIGHT_A), PIN(BOARD_RIGHT_B)}},                     \
    .bus_clock = PIN(BOARD_SCL), .reversed = {BOARD_LEFT_REVERSED, BOARD_RIGHT_REVERSED},                              \
    .analog = {                                                                                                        \
        ANALOG(GYRO), ANALOG(SURGE), ANALOG(SWAY), {BOARD_BATTERY_INPUT, 0, BOARD_BATTERY_FULL_MV * 1e-3 / 1024}}
