/* check.h: CRC-16/CCITT-FALSE, and the check that messages carry in bytes 6 and 7.
 *
 * A transport has its own check, where it has one at all: slcan has none. What leads to the motors is therefore checked from
 * end to end.
 */
#ifndef BRICKPILOT_WIRE_CRC_H
#define BRICKPILOT_WIRE_CRC_H

#include <stdbool.h>

#include "wire/message.h"

#define CRC_START 0xFFFFU

enum { CRC_AT = 6 }; /* of the message's data */

/* The CRC of what went before and of `size` more bytes: polynomial 0x1021, from CRC_START, nothing reflected. Of "123456789"
 * it is 0x29B1. */
uint16_t crc_of_bytes(uint16_t crc, const uint8_t *bytes, uint8_t size);

/* The same of one number more, low byte first. */
uint16_t crc_of_number(uint16_t crc, uint16_t number);

/* CRC over the id, low byte first, and bytes 0 to 5. */
uint16_t crc_of_message(const message_t *message);

/* Puts crc_of_message() into bytes 6 and 7, low byte first. */
void crc_seal(message_t *message);

/* True where the message has 8 bytes and the last two are crc_of_message(). */
bool crc_holds(const message_t *message);

#endif
