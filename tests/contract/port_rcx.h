/* port_rcx.h: what the RCX's own tests need beyond port.h. */
#ifndef BRICKPILOT_CONTRACT_PORT_RCX_H
#define BRICKPILOT_CONTRACT_PORT_RCX_H

/* Sends the host's last packet once more, as it was. */
void port_host_repeat(void);

#endif
