/* flash.h: FLASH, for constant tables. A const table of an AVR chip stands in RAM, too, unless it says that it stays in flash, where other
 * instructions read it. A pointer to it is one to `const FLASH`. On all other processors FLASH is nothing.
 *
 * Beware: where a loop walks through a table, avr-gcc 5.4 at -O2 forgets that it stands in flash (its pass ivopts), and reads RAM. So only
 * bytes_copy_flash() does that, and hal/avr/compile leaves the pass out. tests/vectors finds such errors.
 */
#ifndef BRICKPILOT_CORE_FLASH_H
#define BRICKPILOT_CORE_FLASH_H

#ifdef __AVR__
#define FLASH __flash
#else
#define FLASH
#endif

#endif
