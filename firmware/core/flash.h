/* flash.h: the qualifier FLASH for constant tables. On an AVR chip a const table is copied into RAM. FLASH keeps the
 * table in flash memory instead, and other instructions read it. A pointer to such a table points to `const FLASH`. On
 * other processors FLASH is empty.
 *
 * Beware: if a loop runs through such a table, the compiler pass ivopts of avr-gcc 5.4 at -O2 loses the qualifier, and
 * the loop reads RAM. So only bytes_copy_flash() has such a loop, and hal/avr/compile switches the pass off.
 * tests/vectors finds such errors.
 */
#ifndef BRICKPILOT_CORE_FLASH_H
#define BRICKPILOT_CORE_FLASH_H

#ifdef __AVR__
#define FLASH __flash
#else
#define FLASH
#endif

#endif
