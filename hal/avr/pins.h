/* pins.h: the registers of a pin of board.h. */
#ifndef BRICKPILOT_AVR_PINS_H
#define BRICKPILOT_AVR_PINS_H

#include <avr/io.h>

#include "avr/board.h"

#define PINS_OUT_(letter, bit) PORT##letter
#define PINS_IN_(letter, bit) PIN##letter
#define PINS_DIRECTION_(letter, bit) DDR##letter
#define PINS_BIT_(letter, bit) (1U << (bit))

/* The argument is a pin of board.h, which expands to its port's letter and its bit. */
#define PINS_OUT(...) PINS_OUT_(__VA_ARGS__)
#define PINS_IN(...) PINS_IN_(__VA_ARGS__)
#define PINS_DIRECTION(...) PINS_DIRECTION_(__VA_ARGS__)
#define PINS_BIT(...) PINS_BIT_(__VA_ARGS__)

#endif
