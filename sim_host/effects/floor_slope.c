#include "effects/effect.h"

#include <math.h>

/* Gravity's pull along the body's axes, per mass, m/s^2. */
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

/* Accelerations are means over the last body step, so the heading is taken in its middle. */
static void sensor(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    const bp_state *state = &vehicle->state;
    const pull_t pull = pull_at(value, vehicle, state->heading - 0.5 * vehicle->step * state->yaw_rate);
    vehicle->output[OUTPUT_ACCEL_SURGE] -= pull.surge;
    vehicle->output[OUTPUT_ACCEL_SWAY] -= pull.sway;
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "slope_x",
     .role = BP_ROLE_SIZE,
     .unit = "1",
     .meaning = "sine of the angle by which the floor falls along the earth's x axis, where heading 0 points",
     .minimum = -0.7,
     .maximum = 0.7,
     .preset = 0.03},
    {.name = "slope_y",
     .role = BP_ROLE_SIZE,
     .unit = "1",
     .meaning = "sine of the angle by which the floor falls along the earth's y axis, to the right of that",
     .minimum = -0.7,
     .maximum = 0.7,
     .preset = 0.02,
     .odd = 1},
};

const effect_t effect_floor_slope = {
    .info = {.name = "floor_slope",
             .words = "a slope of the floor",
             .summary = "The floor is not level, so gravity pulls the vehicle downhill and shows in the "
                        "accelerometers.",
             .mechanism = "floor",
             .acts_on = "body",
             .equation = "X + i Y = m g (slope_x + i slope_y) exp(-i psi) at the centre of mass; accelerometers show "
                         "u' - v r and v' + u r less gravity's share. Not for a motor, where it is the same as a "
                         "constant_offset",
             .source = "gravity in body axes and specific force: Fossen 2011, ch. 3 and 14; Titterton & Weston 2004, "
                       "Strapdown Inertial Navigation",
             .parameter_count = 2,
             .parameters = PARAMETERS},
    .hook = {[SITE_BODY] = body, [SITE_SENSOR] = sensor},
};
