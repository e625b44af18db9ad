/* flight_log.h: the log of a closed loop: one row for each control step. */
#ifndef BRICKPILOT_RUN_FLIGHT_LOG_H
#define BRICKPILOT_RUN_FLIGHT_LOG_H

#include "app/loop.h"
#include "sensors/imu.h"
#include "plant/plant.h"
#include "sil/sil.h"

enum { FLIGHT_LOG_COLUMNS = 60 };

/* Returns the name of a column, which ends in its unit; NULL beyond the last. */
const char *flight_log_name(int index);

/* Fills one row of FLIGHT_LOG_COLUMNS. `imu` is the measured reading, `output` the plant's present outputs, `voltage`
 * the motors' command for the next step (V). In a manoeuvre `loop` is NULL, and the controller's columns are 0. */
void flight_log_row(double *row, double time, const plant_t *plant, const double *output, const imu_reading_t *imu,
                    const sil_port_t *port, const double voltage[2], const loop_state_t *loop);

#endif
