#include "app/parameters.h"

#include <stddef.h>

#include "core/bytes.h"
#include "core/fix.h"
#include "wire/codecs_gen.h"
#include "wire/message.h"

#define NUMBER(name) WIRE_PARAMETER_REQUEST_PARAMETER_##name##_CHOICE

/* The last two are those of signed fields. */
enum { BYTE, BOOL, LONG, POSITIVE, VOLTAGE, AT_LEAST_1, UNSIGNED, TIME, SILENCE, SIGNED, OFFSET };

typedef struct {
    int16_t low;
    uint16_t span; /* to the largest */
} range_t;

/* LONG, which is that of fields of 32 bits, goes from 1 to 2^31 - 1. */
static const range_t RANGES[] = {
    [BYTE] = {0, 255},
    [BOOL] = {0, 1},
    [LONG] = {0, 0},
    [POSITIVE] = {0, 32767},
    [VOLTAGE] = {0, 20000},
    [AT_LEAST_1] = {1, 32766},
    [UNSIGNED] = {0, 65535U},
    [TIME] = {0, 10000},
    [SILENCE] = {20, 9980},
    [SIGNED] = {-32767, 65534U},
    [OFFSET] = {-20000, 40000U},
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
    X(LEFT_GAIN, config.step.mixer.drive.left.gain_q15, SIGNED)                                                        \
    X(LEFT_EMF, config.step.mixer.drive.left.emf_mv_q15, SIGNED)                                                       \
    X(LEFT_FRICTION, config.step.mixer.drive.left.friction_mv, VOLTAGE)                                                \
    X(LEFT_OFFSET, config.step.mixer.drive.left.offset_mv, OFFSET)                                                     \
    X(RIGHT_GAIN, config.step.mixer.drive.right.gain_q15, SIGNED)                                                      \
    X(RIGHT_EMF, config.step.mixer.drive.right.emf_mv_q15, SIGNED)                                                     \
    X(RIGHT_FRICTION, config.step.mixer.drive.right.friction_mv, VOLTAGE)                                              \
    X(RIGHT_OFFSET, config.step.mixer.drive.right.offset_mv, OFFSET)                                                   \
    X(DEADBAND, config.step.mixer.drive.deadband_mv, VOLTAGE)                                                          \
    X(HALF_TRACK, config.step.mixer.drive.half_track_m_q14, POSITIVE)                                                  \
    X(RESERVE, config.step.mixer.drive.reserve_mv, VOLTAGE)                                                            \
    X(BATTERY_SAGS, config.step.battery_sags, BOOL)                                                                    \
    X(GYRO_BIAS, config.step.heading.gyro_bias_mrad_s, SIGNED)                                                         \
    X(GYRO_SCALE, config.step.heading.gyro_scale_q15, SIGNED)                                                          \
    X(TRAVEL_SCALE, travel_scale_q15, SIGNED)                                                                          \
    X(COUNT_MISMATCH, config.step.speed.count_mismatch_q15, SIGNED)

typedef struct {
    uint8_t at; /* in parameters_t */
    unsigned size : 3;
    unsigned range : 5;
} place_t;

#define PLACE(name, field, range)                                                                                      \
    [NUMBER(name)] = {offsetof(parameters_t, field), sizeof(((parameters_t *)0)->field), range},

/* By number, which leave none out. */
static const place_t PLACES[] = {OF_CONFIG(PLACE) OF_ROBOT(PLACE)};
enum { PLACES_COUNT = sizeof PLACES / sizeof PLACES[0] };

void parameters_start(parameters_t *parameters, const loop_config_t *constants)
{
    bytes_copy(&parameters->config, constants, sizeof *constants);
    parameters->travel_scale_q15 = 0;
    parameters->believed_travel_um_q2 = constants->step.speed.count_travel_um_q2;
}

uint16_t parameters_travel_um_q2(uint16_t believed, int16_t scale_q15)
{
    const int32_t found = believed + fix_share_q15(believed, scale_q15);

    return (uint16_t)(found > 65535L ? 65535L : found);
}

static bool within(const place_t *place, int32_t value)
{
    const range_t *const range = &RANGES[place->range];

    return place->size == sizeof value ? value > 0 : (uint32_t)value - (uint32_t)(int32_t)range->low <= range->span;
}

static parameters_status_t write(parameters_t *parameters, const place_t *place, const uint8_t *value)
{
    int32_t number;

    message_move(&number, value, sizeof number);
    if (!within(place, number))
        return PARAMETERS_RANGE;
    message_move((uint8_t *)parameters + place->at, value, place->size);
    parameters->config.step.speed.count_travel_um_q2 =
        parameters_travel_um_q2(parameters->believed_travel_um_q2, parameters->travel_scale_q15);
    return PARAMETERS_OK;
}

static void read(const parameters_t *parameters, const place_t *place, uint8_t *value)
{
    const void *const field = (const uint8_t *)parameters + place->at;
    const bool negative = place->range >= SIGNED && *(const int16_t *)field < 0;

    message_put(value + 2, negative ? 0xFFFF : 0);
    value[1] = 0;
    message_move(value, field, place->size);
}

parameters_status_t parameters_take(parameters_t *parameters, bool running, uint8_t *data)
{
    const uint8_t index = data[WIRE_PARAMETER_REQUEST_PARAMETER_AT] & WIRE_PARAMETER_REQUEST_PARAMETER_MASK;
    uint8_t *const value = &data[WIRE_PARAMETER_VALUE_AT];
    parameters_status_t status = PARAMETERS_OK;

    if (index >= PLACES_COUNT) {
        message_put(value, 0);
        message_put(value + 2, 0);
        return PARAMETERS_UNKNOWN;
    }
    if (data[WIRE_PARAMETER_REQUEST_WRITE_AT] & 1U << WIRE_PARAMETER_REQUEST_WRITE_SHIFT) {
        if (running && index >= NUMBER(LEFT_GAIN))
            status = PARAMETERS_BUSY;
        else
            status = write(parameters, &PLACES[index], value);
    }
    read(parameters, &PLACES[index], value);
    return status;
}
