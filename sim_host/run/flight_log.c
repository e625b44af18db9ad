#include "run/flight_log.h"

#include <stddef.h>

static const double TURN = 6.283185307179586;

/* The columns, in the order in which flight_log_row() writes them. */
static const char *const NAMES[] = {
    "time_s", "true_x_m", "true_y_m", "true_heading_rad", "true_speed_m_s", "true_sway_m_s", "true_yaw_rate_rad_s",
    "true_accel_surge_m_s2", "true_accel_sway_m_s2", "left_wheel_rad_s", "right_wheel_rad_s", "left_current_a",
    "right_current_a", "battery_v", "left_voltage_v", "right_voltage_v", "charge_c",
    /* sensors */
    "measured_accel_surge_m_s2", "measured_accel_sway_m_s2", "measured_yaw_rate_rad_s", "measured_left_counts",
    "measured_right_counts",
    /* controller */
    "estimate_x_m", "estimate_y_m", "estimate_heading_rad", "estimate_speed_m_s", "estimate_yaw_rate_rad_s", "at_rest",
    "bias_unknown", "gyro_full_steps", "mode", "fault", "phase", "waypoint", "overshoots", "demand_speed_m_s",
    "demand_heading_rad", "heading_error_rad", "cross_track_m", "speed_p_v", "speed_i_v", "speed_d_v", "yaw_p_v",
    "yaw_i_v", "yaw_d_v", "surge_effort_v", "yaw_effort_v", "left_duty", "right_duty", "surge_saturated",
    "yaw_saturated",
    /* monitor: the code of a cause, its size in V or as a share, and since when */
    "left_cause", "left_cause_size", "left_cause_since_s", "right_cause", "right_cause_size", "right_cause_since_s",
    "battery_cause", "battery_cause_size", "battery_cause_since_s"};

_Static_assert(sizeof NAMES / sizeof *NAMES == FLIGHT_LOG_COLUMNS, "FLIGHT_LOG_COLUMNS counts NAMES");

const char *flight_log_name(int index)
{
    return index >= 0 && index < FLIGHT_LOG_COLUMNS ? NAMES[index] : NULL;
}

static double *put_truth(double *at, double time, const plant_t *plant, const double *output, const double voltage[2])
{
    const bp_state *state = &plant->vehicle.state;
    const double values[] = {time,
                             state->x,
                             state->y,
                             state->heading,
                             state->surge,
                             state->sway,
                             state->yaw_rate,
                             plant->vehicle.accel_surge,
                             plant->vehicle.accel_sway,
                             state->wheel_speed[0],
                             state->wheel_speed[1],
                             state->current[0],
                             state->current[1],
                             output[OUTPUT_BATTERY_VOLTAGE],
                             voltage[0],
                             voltage[1],
                             state->charge};
    for (size_t i = 0; i < sizeof values / sizeof *values; i++)
        *at++ = values[i];
    return at;
}

static double *put_sensors(double *at, const imu_reading_t *imu, const sil_port_t *port)
{
    *at++ = imu->accel_surge;
    *at++ = imu->accel_sway;
    *at++ = imu->yaw_rate;
    *at++ = (int16_t)port->rotation.left;
    *at++ = (int16_t)port->rotation.right;
    return at;
}

static double bam16_to_rad(uint16_t angle)
{
    return (int16_t)angle * (TURN / 65536.0);
}

/* The reports of the three channels; 0 if this firmware has no monitor. */
static void put_monitor(double *at, const loop_state_t *loop)
{
    for (int i = 0; i < MONITOR_CHANNELS; i++) {
#ifndef MONITOR_OFF
        const monitor_report_t report = loop->step.monitor.report[i];
#else
        const monitor_report_t report = {.since_ms = 0};
        (void)loop;
#endif
        *at++ = report.cause;
        *at++ = report.size * 1e-3;
        *at++ = report.since_ms * 1e-3;
    }
}

static void put_controller(double *at, const loop_state_t *loop, const sil_port_t *port)
{
    const step_output_t *out = &loop->output;
    const mode_state_t *mode = &loop->step.mode;
    const double values[] = {out->estimate.x_um * 1e-6,
                             out->estimate.y_um * 1e-6,
                             bam16_to_rad(out->estimate.heading_bam16),
                             out->estimate.speed_mm_s_q4 / 16e3,
                             out->estimate.yaw_rate_mrad_s * 1e-3,
                             out->estimate.at_rest,
                             out->estimate.bias_unknown,
                             loop->step.heading.full_steps,
                             mode->mode,
                             mode->fault,
                             mode->los.phase,
                             mode->los.waypoint,
                             mode->los.overshoots,
                             out->demand.speed_mm_s_q4 / 16e3,
                             bam16_to_rad(out->demand.heading_bam16),
                             mode->los.heading_error_bam16 * (TURN / 65536.0),
                             mode->los.cross_track_mm * 1e-3,
                             out->speed_pid.proportional_mv * 1e-3,
                             out->speed_pid.integral_mv * 1e-3,
                             out->speed_pid.derivative_mv * 1e-3,
                             out->heading_pid.proportional_mv * 1e-3,
                             out->heading_pid.integral_mv * 1e-3,
                             out->heading_pid.derivative_mv * 1e-3,
                             out->effort.surge_mv * 1e-3,
                             out->effort.yaw_mv * 1e-3,
                             port->left_q15 / 32767.0,
                             port->right_q15 / 32767.0,
                             out->drive.surge_saturated,
                             out->drive.yaw_saturated};
    for (size_t i = 0; i < sizeof values / sizeof *values; i++)
        *at++ = values[i];
    put_monitor(at, loop);
}

void flight_log_row(double *row, double time, const plant_t *plant, const double *output, const imu_reading_t *imu,
                    const sil_port_t *port, const double voltage[2], const loop_state_t *loop)
{
    double *at = put_sensors(put_truth(row, time, plant, output, voltage), imu, port);
    if (loop != NULL) {
        put_controller(at, loop, port);
        return;
    }
    while (at < row + FLIGHT_LOG_COLUMNS)
        *at++ = 0;
}
