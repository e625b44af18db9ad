#include "app/parameters.h"

#include "core/bytes.h"
#include "wire/codecs_gen.h"

#define NUMBER(name) WIRE_PARAMETER_REQUEST_PARAMETER_##name##_CHOICE

/* Number in the DBC, type, field, smallest, largest. Ranges are those of the structs' headers. */
#define OF_CONFIG(X)                                                                                                   \
    X(SPEED_KP, int16_t, config.step.speed_pid.kp_mv_q10, 0, 32767)                                                    \
    X(SPEED_KI, int16_t, config.step.speed_pid.ki_mv_q10, 0, 32767)                                                    \
    X(SPEED_KD, int16_t, config.step.speed_pid.kd_mv_q10, 0, 32767)                                                    \
    X(SPEED_LIMIT, int16_t, config.step.speed_pid.limit_mv, 0, 20000)                                                  \
    X(HEADING_KP, int16_t, config.step.heading_pid.kp_mv_q10, 0, 32767)                                                \
    X(HEADING_KI, int16_t, config.step.heading_pid.ki_mv_q10, 0, 32767)                                                \
    X(HEADING_KD, int16_t, config.step.heading_pid.kd_mv_q10, 0, 32767)                                                \
    X(HEADING_LIMIT, int16_t, config.step.heading_pid.limit_mv, 0, 20000)                                              \
    X(FEEDFORWARD, int16_t, config.step.feedforward_mv_q10, 0, 32767)                                                  \
    X(CRUISE, int16_t, config.step.mode.los.cruise_mm_s_q4, 1, 32767)                                                  \
    X(CREEP, int16_t, config.step.mode.los.creep_mm_s_q4, 0, 32767)                                                    \
    X(DECEL, uint16_t, config.step.mode.los.decel_mm_s2, 1, 32767)                                                     \
    X(ACCEPTANCE, uint16_t, config.step.mode.los.acceptance_mm, 1, 32767)                                              \
    X(BEARING_HOLD, uint16_t, config.step.mode.los.bearing_hold_mm, 0, 32767)                                          \
    X(PIVOT, uint16_t, config.step.mode.los.pivot_bam16, 1, 32767)                                                     \
    X(ALIGN, uint16_t, config.step.mode.los.align_bam16, 1, 32767)                                                     \
    X(REST_SPEED, uint16_t, config.step.mode.los.rest_speed_mm_s_q4, 0, 65535)                                         \
    X(REST_TIME, uint16_t, config.step.mode.los.rest_ms, 0, 65535)                                                     \
    X(REST_YAW_RATE, uint16_t, config.step.mode.los.rest_yaw_rate_mrad_s, 0, 65535)                                    \
    X(SETTLE_TIME, uint16_t, config.step.mode.los.settle_ms, 0, 65535)                                                 \
    X(OVERSHOOT, uint16_t, config.step.mode.los.overshoot_mm, 1, 32767)                                                \
    X(MAX_OVERSHOOTS, uint8_t, config.step.mode.los.max_overshoots, 0, 255)                                            \
    X(SKIP_FAILED, bool, config.step.mode.los.skip_failed, 0, 1)                                                       \
    X(LEG_TIMEOUT, uint32_t, config.step.mode.los.leg_timeout_ms, 1, 2147483647)                                       \
    X(LOST_TIME, uint16_t, config.step.mode.lost_ms, 0, 10000)                                                         \
    X(MAX_DUTY, int16_t, config.step.mixer.max_duty_q15, 1, 32767)                                                     \
    X(TELEMETRY_EVERY, uint8_t, config.telemetry_every, 0, 255)                                                        \
    X(SILENT_TIME, uint16_t, config.silent_ms, 20, 10000)
#define OF_ROBOT(X)                                                                                                    \
    X(LEFT_GAIN, int16_t, compensation.drive.left.gain_q15, -32767, 32767)                                             \
    X(LEFT_EMF, int16_t, compensation.drive.left.emf_mv_q15, -32767, 32767)                                            \
    X(LEFT_FRICTION, int16_t, compensation.drive.left.friction_mv, 0, 20000)                                           \
    X(LEFT_OFFSET, int16_t, compensation.drive.left.offset_mv, -20000, 20000)                                          \
    X(RIGHT_GAIN, int16_t, compensation.drive.right.gain_q15, -32767, 32767)                                           \
    X(RIGHT_EMF, int16_t, compensation.drive.right.emf_mv_q15, -32767, 32767)                                          \
    X(RIGHT_FRICTION, int16_t, compensation.drive.right.friction_mv, 0, 20000)                                         \
    X(RIGHT_OFFSET, int16_t, compensation.drive.right.offset_mv, -20000, 20000)                                        \
    X(DEADBAND, int16_t, compensation.drive.deadband_mv, 0, 20000)                                                     \
    X(HALF_TRACK, int16_t, compensation.drive.half_track_m_q14, 0, 32767)                                              \
    X(RESERVE, int16_t, compensation.drive.reserve_mv, 0, 20000)                                                       \
    X(BATTERY_SAGS, bool, compensation.battery_sags, 0, 1)                                                             \
    X(GYRO_BIAS, int16_t, compensation.gyro_bias_mrad_s, -32767, 32767)                                                \
    X(GYRO_SCALE, int16_t, compensation.gyro_scale_q15, -32767, 32767)                                                 \
    X(TRAVEL_SCALE, int16_t, compensation.travel_scale_q15, -32767, 32767)                                             \
    X(COUNT_MISMATCH, int16_t, compensation.count_mismatch_q15, -32767, 32767)

void parameters_start(parameters_t *parameters, const loop_config_t *constants)
{
    bytes_clear(parameters, sizeof *parameters);
    bytes_copy(&parameters->config, constants, sizeof *constants);
    parameters->believed_travel_um_q2 = constants->step.speed.count_travel_um_q2;
}

parameters_status_t parameters_read(const parameters_t *parameters, uint8_t index, int32_t *value)
{
    switch (index) {
#define READ(name, type, field, low, high)                                                                             \
    case NUMBER(name):                                                                                                 \
        *value = (int32_t)parameters->field;                                                                           \
        return PARAMETERS_OK;
        OF_CONFIG(READ)
        OF_ROBOT(READ)
#undef READ
    default:
        return PARAMETERS_UNKNOWN;
    }
}

/* The ends of a range are long constants: an int may have 16 bits. */
#define WRITE(name, type, field, low, high)                                                                            \
    case NUMBER(name):                                                                                                 \
        if (value < (int32_t)(low##L) || value > (int32_t)(high##L))                                                   \
            return PARAMETERS_RANGE;                                                                                   \
        parameters->field = (type)value;                                                                               \
        return PARAMETERS_OK;

static parameters_status_t write_config(parameters_t *parameters, uint8_t index, int32_t value)
{
    switch (index) {
        OF_CONFIG(WRITE)
    default:
        return PARAMETERS_UNKNOWN;
    }
}

static parameters_status_t write_robot(parameters_t *parameters, uint8_t index, int32_t value)
{
    switch (index) {
        OF_ROBOT(WRITE)
    default:
        return PARAMETERS_UNKNOWN;
    }
}

parameters_status_t parameters_write(parameters_t *parameters, uint8_t index, int32_t value, bool running)
{
    parameters_status_t status = write_config(parameters, index, value);

    if (status != PARAMETERS_UNKNOWN)
        return status;
    if (running && index >= NUMBER(LEFT_GAIN) && index <= NUMBER(COUNT_MISMATCH))
        return PARAMETERS_BUSY;
    status = write_robot(parameters, index, value);
    if (status == PARAMETERS_OK) {
        parameters->config.step.speed.count_travel_um_q2 = parameters->believed_travel_um_q2;
        compensation_apply(&parameters->compensation, &parameters->config);
    }
    return status;
}
