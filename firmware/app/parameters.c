#include "app/parameters.h"

#include <stddef.h>

#include "core/bytes.h"
#include "wire/codecs_gen.h"

#define NUMBER(name) WIRE_PARAMETER_REQUEST_PARAMETER_##name##_CHOICE

enum { POSITIVE, VOLTAGE, AT_LEAST_1, UNSIGNED, BYTE, BOOL, LONG, TIME, SILENCE, SIGNED, OFFSET };

typedef struct {
    int32_t low, high;
} range_t;

static const range_t RANGES[] = {
    [POSITIVE] = {0, 32767L},     [VOLTAGE] = {0, 20000L},      [AT_LEAST_1] = {1, 32767L},
    [UNSIGNED] = {0, 65535L},     [BYTE] = {0, 255L},           [BOOL] = {0, 1L},
    [LONG] = {1, 2147483647L},    [TIME] = {0, 10000L},         [SILENCE] = {20, 10000L},
    [SIGNED] = {-32767L, 32767L}, [OFFSET] = {-20000L, 20000L},
};

/* Number in the DBC, field, its range: those of the structs' headers. */
#define OF_CONFIG(X)                                                                                                   \
    X(SPEED_KP, config.step.speed_pid.kp_mv_q10, POSITIVE)                                                             \
    X(SPEED_KI, config.step.speed_pid.ki_mv_q10, POSITIVE)                                                             \
    X(SPEED_KD, config.step.speed_pid.kd_mv_q10, POSITIVE)                                                             \
    X(SPEED_LIMIT, config.step.speed_pid.limit_mv, VOLTAGE)                                                            \
    X(HEADING_KP, config.step.heading_pid.kp_mv_q10, POSITIVE)                                                         \
    X(HEADING_KI, config.step.heading_pid.ki_mv_q10, POSITIVE)                                                         \
    X(HEADING_KD, config.step.heading_pid.kd_mv_q10, POSITIVE)                                                         \
    X(HEADING_LIMIT, config.step.heading_pid.limit_mv, VOLTAGE)                                                        \
    X(FEEDFORWARD, config.step.feedforward_mv_q10, POSITIVE)                                                           \
    X(CRUISE, config.step.mode.los.cruise_mm_s_q4, AT_LEAST_1)                                                         \
    X(CREEP, config.step.mode.los.creep_mm_s_q4, POSITIVE)                                                             \
    X(DECEL, config.step.mode.los.decel_mm_s2, AT_LEAST_1)                                                             \
    X(ACCEPTANCE, config.step.mode.los.acceptance_mm, AT_LEAST_1)                                                      \
    X(BEARING_HOLD, config.step.mode.los.bearing_hold_mm, POSITIVE)                                                    \
    X(PIVOT, config.step.mode.los.pivot_bam16, AT_LEAST_1)                                                             \
    X(ALIGN, config.step.mode.los.align_bam16, AT_LEAST_1)                                                             \
    X(REST_SPEED, config.step.mode.los.rest_speed_mm_s_q4, UNSIGNED)                                                   \
    X(REST_TIME, config.step.mode.los.rest_ms, UNSIGNED)                                                               \
    X(REST_YAW_RATE, config.step.mode.los.rest_yaw_rate_mrad_s, UNSIGNED)                                              \
    X(SETTLE_TIME, config.step.mode.los.settle_ms, UNSIGNED)                                                           \
    X(OVERSHOOT, config.step.mode.los.overshoot_mm, AT_LEAST_1)                                                        \
    X(MAX_OVERSHOOTS, config.step.mode.los.max_overshoots, BYTE)                                                       \
    X(SKIP_FAILED, config.step.mode.los.skip_failed, BOOL)                                                             \
    X(LEG_TIMEOUT, config.step.mode.los.leg_timeout_ms, LONG)                                                          \
    X(LOST_TIME, config.step.mode.lost_ms, TIME)                                                                       \
    X(MAX_DUTY, config.step.mixer.max_duty_q15, AT_LEAST_1)                                                            \
    X(TELEMETRY_EVERY, config.telemetry_every, BYTE)                                                                   \
    X(SILENT_TIME, config.silent_ms, SILENCE)
#define OF_ROBOT(X)                                                                                                    \
    X(LEFT_GAIN, compensation.drive.left.gain_q15, SIGNED)                                                             \
    X(LEFT_EMF, compensation.drive.left.emf_mv_q15, SIGNED)                                                            \
    X(LEFT_FRICTION, compensation.drive.left.friction_mv, VOLTAGE)                                                     \
    X(LEFT_OFFSET, compensation.drive.left.offset_mv, OFFSET)                                                          \
    X(RIGHT_GAIN, compensation.drive.right.gain_q15, SIGNED)                                                           \
    X(RIGHT_EMF, compensation.drive.right.emf_mv_q15, SIGNED)                                                          \
    X(RIGHT_FRICTION, compensation.drive.right.friction_mv, VOLTAGE)                                                   \
    X(RIGHT_OFFSET, compensation.drive.right.offset_mv, OFFSET)                                                        \
    X(DEADBAND, compensation.drive.deadband_mv, VOLTAGE)                                                               \
    X(HALF_TRACK, compensation.drive.half_track_m_q14, POSITIVE)                                                       \
    X(RESERVE, compensation.drive.reserve_mv, VOLTAGE)                                                                 \
    X(BATTERY_SAGS, compensation.battery_sags, BOOL)                                                                   \
    X(GYRO_BIAS, compensation.gyro_bias_mrad_s, SIGNED)                                                                \
    X(GYRO_SCALE, compensation.gyro_scale_q15, SIGNED)                                                                 \
    X(TRAVEL_SCALE, compensation.travel_scale_q15, SIGNED)                                                             \
    X(COUNT_MISMATCH, compensation.count_mismatch_q15, SIGNED)

typedef struct {
    uint16_t at; /* in parameters_t */
    uint8_t size;
    uint8_t range; /* a field below zero is an int16_t */
} place_t;

#define PLACE(name, field, range)                                                                                      \
    [NUMBER(name)] = {offsetof(parameters_t, field), sizeof(((parameters_t *)0)->field), range},

/* By number; a number that is not given out has size 0. */
static const place_t PLACES[] = {OF_CONFIG(PLACE) OF_ROBOT(PLACE)};

static const place_t *place_of(uint8_t index)
{
    return index < sizeof PLACES / sizeof PLACES[0] && PLACES[index].size > 0 ? &PLACES[index] : NULL;
}

static bool of_robot(uint8_t index)
{
    return index >= NUMBER(LEFT_GAIN) && index <= NUMBER(COUNT_MISMATCH);
}

void parameters_start(parameters_t *parameters, const loop_config_t *constants)
{
    bytes_clear(parameters, sizeof *parameters);
    bytes_copy(&parameters->config, constants, sizeof *constants);
    parameters->believed_travel_um_q2 = constants->step.speed.count_travel_um_q2;
}

parameters_status_t parameters_read(const parameters_t *parameters, uint8_t index, int32_t *value)
{
    const place_t *const place = place_of(index);
    const void *field;

    if (place == NULL)
        return PARAMETERS_UNKNOWN;
    field = (const uint8_t *)parameters + place->at;
    if (place->size == sizeof(uint32_t))
        *value = *(const int32_t *)field;
    else if (place->size == sizeof(uint8_t))
        *value = *(const uint8_t *)field;
    else if (RANGES[place->range].low < 0)
        *value = *(const int16_t *)field;
    else
        *value = *(const uint16_t *)field;
    return PARAMETERS_OK;
}

static parameters_status_t write(parameters_t *parameters, const place_t *place, int32_t value)
{
    const range_t *const range = &RANGES[place->range];
    void *const field = (uint8_t *)parameters + place->at;

    if (value < range->low || value > range->high)
        return PARAMETERS_RANGE;
    if (place->size == sizeof(uint32_t))
        *(uint32_t *)field = (uint32_t)value;
    else if (place->size == sizeof(uint8_t))
        *(uint8_t *)field = (uint8_t)value;
    else
        *(uint16_t *)field = (uint16_t)value;
    return PARAMETERS_OK;
}

parameters_status_t parameters_write(parameters_t *parameters, uint8_t index, int32_t value, bool running)
{
    const place_t *const place = place_of(index);
    parameters_status_t status;

    if (place == NULL)
        return PARAMETERS_UNKNOWN;
    if (running && of_robot(index))
        return PARAMETERS_BUSY;
    status = write(parameters, place, value);
    if (status == PARAMETERS_OK && of_robot(index)) {
        parameters->config.step.speed.count_travel_um_q2 = parameters->believed_travel_um_q2;
        compensation_apply(&parameters->compensation, &parameters->config);
    }
    return status;
}
