#include "effects/effect.h"

#include <math.h>

/* Gravity's pull in body axes over mass, m/s^2. */
typedef struct {
    double surge, sway;
} pull_t;

static pull_t pull_at(const double *value, const vehicle_t *vehicle, double heading)
{
    const double gravity = vehicle->parameter[PARAMETER_GRAVITY], cosine = cos(heading), sine = sin(heading);
    return (pull_t){gravity * (value[0] * cosine + value[1] * sine), gravity * (value[1] * cosine - value[0] * sine)};
}

static void body(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    const build_t *build = &vehicle->build;
    const pull_t pull = pull_at(value, vehicle, vehicle->middle.heading);
    if (vehicle->vehicle == BP_MOTOR)
        return;
    vehicle->force_surge += build->mass * pull.surge;
    vehicle->force_sway += build->mass * pull.sway;
    vehicle->moment_yaw += build->mass * (build->com_forward * pull.sway - build->com_right * pull.surge);
}

/* The accelerations are means over the last body step: so is the heading. */
static void sensor(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    const bp_state *state = &vehicle->state;
    const pull_t pull = pull_at(value, vehicle, state->heading - 0.5 * vehicle->step * state->yaw_rate);
    vehicle->output[OUTPUT_ACCEL_SURGE] -= pull.surge;
    vehicle->output[OUTPUT_ACCEL_SWAY] -= pull.sway;
}

static const bp_parameter_info PARAMETERS[] = {
    {"slope_x", "1", "sine of the floor's fall along the earth's x axis, where heading 0 points", -0.7, 0.7, 0.03, 0},
    {"slope_y", "1", "sine of its fall along the earth's y axis, to the right of that", -0.7, 0.7, 0.02, 1},
};

const effect_t effect_floor_slope = {
    .info = {.name = "floor_slope",
             .acts_on = "body",
             .equation = "X + i Y = m g (slope_x + i slope_y) exp(-i psi) at the centre of mass; accelerometers show "
                         "u' - v r and v' + u r less gravity's share. Not for a motor: there it is a constant_offset",
             .source = "gravity in body axes and specific force: Fossen 2011, ch. 3 and 14; Titterton & Weston 2004, "
                       "Strapdown Inertial Navigation",
             .parameter_count = 2,
             .parameters = PARAMETERS},
    .hook = {[SITE_BODY] = body, [SITE_SENSOR] = sensor},
};
