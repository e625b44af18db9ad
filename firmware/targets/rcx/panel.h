/* panel.h: buttons and display. Run and On-Off are the kernel's: they end the program. */
#ifndef BRICKPILOT_TARGETS_RCX_PANEL_H
#define BRICKPILOT_TARGETS_RCX_PANEL_H

#include "app/step.h"

enum { PANEL_VIEW = 0x04, PANEL_PRGM = 0x08 };

/* Buttons pressed since the last call, PANEL_ bits. The kernel takes a button's state for 100 ms each. */
uint8_t panel_pressed(void);

/* "idLE", "rESt" before a start, "run" and the number of the waypoint ahead from 1, "donE", "Err" and the fault's number. */
void panel_show(const mode_state_t *mode, bool starting);

#endif
