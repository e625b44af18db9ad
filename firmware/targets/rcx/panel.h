/* panel.h: buttons and display. The kernel handles Run and On-Off itself: they end the program. */
#ifndef BRICKPILOT_TARGETS_RCX_PANEL_H
#define BRICKPILOT_TARGETS_RCX_PANEL_H

#include "app/step.h"

enum { PANEL_VIEW = 0x04, PANEL_PRGM = 0x08 };

/* Returns the buttons pressed since the last call, as PANEL_ bits. The kernel looks at a button every 100 ms. */
uint8_t panel_pressed(void);

/* Shows "idLE", "rESt" before a start, "run" and the number of the next waypoint, from 1, "donE", or "Err" and the fault's number. */
void panel_show(const mode_state_t *mode, bool starting);

#endif
