/* sensors.h: the inputs. hal.h reads them. */
#ifndef BRICKPILOT_RCX_SENSORS_H
#define BRICKPILOT_RCX_SENSORS_H

/* Powers the inputs as board.h says. Rotation counts begin at 0, with the wheels at rest. */
void sensors_start(void);

#endif
