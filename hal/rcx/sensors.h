/* sensors.h: the inputs. The readings themselves are hal.h's. */
#ifndef BRICKPILOT_RCX_SENSORS_H
#define BRICKPILOT_RCX_SENSORS_H

/* Powers the inputs as board.h says; rotation counts from 0, with the wheels at rest. */
void sensors_start(void);

#endif
