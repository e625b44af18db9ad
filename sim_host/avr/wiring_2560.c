#define BOARD_ATMEGA2560
#include "avr/wiring_of_board.h"

const wiring_t WIRING_2560 = {.chip = "atmega2560",
                              .pin_change_mask = 0x6D,
                              .pin_change_vector = 11,
                              .largest_boot_section = 8192,
                              WIRING_OF_BOARD};
