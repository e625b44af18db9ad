#include "avr/wiring_of_board.h"

const wiring_t WIRING_328P = {.chip = "atmega328p",
                              .pin_change_mask = 0x6D,
                              .pin_change_vector = 5,
                              .largest_boot_section = 4096,
                              WIRING_OF_BOARD};
