#include "app/parameters.h"

#include <stddef.h>

#include "core/bytes.h"
#include "core/fix.h"
#include "wire/codecs_gen.h"
#include "wire/message.h"

#define NUMBER(name) WIRE_PARAMETER_REQUEST_PARAMETER_##name##_CHOICE

/* A range goes with a field's type: uint8_t or bool, uint32_t, or else 16 bits. The last two are those of signed fields. */
enum { BYTE, BOOL, LONG, POSITIVE, VOLTAGE, AT_LEAST_1, UNSIGNED, TIME, SILENCE, SIGNED, OFFSET };
#define SIZE(range) ((range) <= BOOL ? 1 : (range) == LONG ? 4 : 2)

typedef struct {
    int16_t low;
    uint16_t high; /* 0: as far as 32 bits go */
} range_t;

static const range_t RANGES[] = {
    [BYTE] = {0, 255},
    [BOOL] = {0, 1},
    [LONG] = {1, 0},
    [POSITIVE] = {0, 32767},
    [VOLTAGE] = {0, 20000},
    [AT_LEAST_1] = {1, 32767},
    [UNSIGNED] = {0, 65535U},
    [TIME] = {0, 10000},
    [SILENCE] = {20, 10000},
    [SIGNED] = {-32767, 32767},
    [OFFSET] = {-20000, 20000},
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
    uint8_t range;
} place_t;

/* The second 0 is none where the field's type is not its range's. */
#define PLACE(name, field, range)                                                                                      \
    [NUMBER(name)] = {offsetof(parameters_t, field),                                                                   \
                      (range) + 0 * sizeof(char[sizeof(((parameters_t *)0)->field) == SIZE(range) ? 1 : -1])},

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

bool parameters_of_robot(uint8_t index)
{
    return index >= NUMBER(LEFT_GAIN) && index < PLACES_COUNT;
}

parameters_status_t parameters_read(const parameters_t *parameters, uint8_t index, uint8_t *value)
{
    uint8_t size = 0, beyond = 0;
    parameters_status_t status = PARAMETERS_UNKNOWN;

    if (index < PLACES_COUNT) {
        const place_t *const place = &PLACES[index];

        size = SIZE(place->range);
        message_move(value, (const uint8_t *)parameters + place->at, size);
        if (place->range >= SIGNED && value[1] >= 0x80U)
            beyond = 0xFF;
        status = PARAMETERS_OK;
    }
    for (; size < 4; size++)
        value[size] = beyond;
    return status;
}

static bool within(const range_t *range, int32_t value)
{
    return value >= range->low && (range->high == 0 || value <= (int32_t)range->high);
}

parameters_status_t parameters_write(parameters_t *parameters, uint8_t index, const uint8_t *value)
{
    const place_t *place;
    int32_t number;

    if (index >= PLACES_COUNT)
        return PARAMETERS_UNKNOWN;
    place = &PLACES[index];
    message_move(&number, value, sizeof number);
    if (!within(&RANGES[place->range], number))
        return PARAMETERS_RANGE;
    message_move((uint8_t *)parameters + place->at, value, SIZE(place->range));
    parameters->config.step.speed.count_travel_um_q2 =
        parameters_travel_um_q2(parameters->believed_travel_um_q2, parameters->travel_scale_q15);
    return PARAMETERS_OK;
}
