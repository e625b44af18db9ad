#include "effects/effect.h"

/* Angles and travels of both wheels, or of a motor, and their speeds. */
static const int ANGLES[] = {OUTPUT_WHEEL_ANGLE_LEFT,
                             OUTPUT_WHEEL_ANGLE_RIGHT,
                             OUTPUT_WHEEL_TRAVEL_LEFT,
                             OUTPUT_WHEEL_TRAVEL_RIGHT,
                             OUTPUT_ANGLE,
                             OUTPUT_POSITION};
static const int SPEEDS[] = {OUTPUT_WHEEL_SPEED_LEFT,
                             OUTPUT_WHEEL_SPEED_RIGHT,
                             OUTPUT_WHEEL_VELOCITY_LEFT,
                             OUTPUT_WHEEL_VELOCITY_RIGHT,
                             OUTPUT_SPEED,
                             OUTPUT_VELOCITY};
enum { CHANNELS = sizeof ANGLES / sizeof ANGLES[0] };

typedef struct {
    real_t started;
    real_t last[CHANNELS], back[CHANNELS]; /* true angle one step ago; angle turned backward since the start */
} count_t;

static void sensor(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    count_t *count = (count_t *)memory;
    for (int i = 0; i < CHANNELS; i++) {
        real_t *angle = &vehicle->output[ANGLES[i]], *speed = &vehicle->output[SPEEDS[i]];
        const real_t turned = choose(count->started == 0, real_of(0), *angle - count->last[i]);
        count->last[i] = *angle;
        count->back[i] += real_most(-turned, real_of(0));
        *angle += 2 * value[0] * count->back[i];
        *speed += value[0] * (real_abs(*speed) - *speed);
    }
    count->started = real_of(1);
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "share",
     .role = BP_ROLE_SIZE,
     .unit = "1",
     .meaning = "1: a turn backward reads as one forward; below 1 a part of the sign is left",
     .minimum = 0,
     .maximum = 1,
     .preset = 1},
};

const effect_t effect_unsigned_sensor = {
    .info = {.name = "unsigned_sensor",
             .words = "a rotation sensor that does not know the direction",
             .summary = "The rotation sensor counts alike in both directions, so its reading never falls below zero.",
             .mechanism = "sensor",
             .acts_on = "sensor",
             .equation = "speed = (1 - share) w + share |w|; angle and travel are its integral",
             .source = "single-channel encoder: Borenstein, Everett & Feng 1996, Where am I?; the pulse counter of "
                       "Wigren & Schoukens 2017, coupled electric drives",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "Slotted discs with one light barrier are common on cheap robots.",
             .advice = "Use both channels of the encoder, or give each count the sign of the motion.",
             .parameter_count = 1,
             .parameters = PARAMETERS,
             .stated_by = "unsigned"},
    .memory_count = sizeof(count_t) / sizeof(real_t),
    .hook = {[SITE_SENSOR] = sensor},
};
