/* port_avr.h: what the tests of the AVR port need beyond port.h. */
#ifndef BRICKPILOT_CONTRACT_PORT_AVR_H
#define BRICKPILOT_CONTRACT_PORT_AVR_H

#include "../avr/mailbox.h"

extern volatile mailbox_t mailbox;

/* Makes a request (mailbox.h) of the world. */
void port_ask(uint8_t request);

/* Sends bytes from the host, at most MAILBOX_BYTES, and waits until they have come. */
void port_host_bytes(const uint8_t *bytes, uint8_t size);

#endif
