/* crc.h: CRC-16/CCITT-FALSE, and the CRC that messages have in bytes 6 and 7.
 *
 * Some transports have a checksum of their own, but slcan has none. So every message that can move the motors has an
 * end-to-end CRC.
 */
#ifndef BRICKPILOT_WIRE_CRC_H
#define BRICKPILOT_WIRE_CRC_H

#include <stdbool.h>

#include "wire/message.h"

#define CRC_START 0xFFFFU

enum { CRC_AT = 6 }; /* index of the CRC in the message's data */

/* Continues `crc` with `size` bytes. The first call takes CRC_START. Polynomial 0x1021, not reflected; the CRC of
 * "123456789" is 0x29B1. */
uint16_t crc_of_bytes(uint16_t crc, const uint8_t *bytes, uint8_t size);

/* Continues `crc` with one number, low byte first. */
uint16_t crc_of_number(uint16_t crc, uint16_t number);

/* The CRC of the id, low byte first, and bytes 0 to 5. */
uint16_t crc_of_message(const message_t *message);

/* Writes crc_of_message() into bytes 6 and 7, low byte first. */
void crc_seal(message_t *message);

/* True if the message has 8 bytes and the last two are its CRC. */
bool crc_holds(const message_t *message);

#endif
