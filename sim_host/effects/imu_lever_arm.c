#include "effects/effect.h"

/* Uses means over the body step, like the accelerations that it adds to. */
static void sensor(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    const real_t x = value[0], y = value[1];
    const real_t turn = vehicle->state.yaw_rate - 0.5 * vehicle->step * vehicle->yaw_accel;
    vehicle->output[OUTPUT_ACCEL_SURGE] -= turn * turn * x + vehicle->yaw_accel * y;
    vehicle->output[OUTPUT_ACCEL_SWAY] -= turn * turn * y - vehicle->yaw_accel * x;
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "x",
     .role = BP_ROLE_SIZE,
     .unit = "m",
     .meaning = "distance of the accelerometers ahead of the middle of the axle",
     .minimum = -5,
     .maximum = 5,
     .preset = 0.03,
     .says = "the accelerometers are {} ahead of the axle",
     .says_below = "the accelerometers are {} behind the axle"},
    {.name = "y",
     .role = BP_ROLE_SIZE,
     .unit = "m",
     .meaning = "distance of the accelerometers to the right of it",
     .minimum = -5,
     .maximum = 5,
     .preset = 0.02,
     .odd = 1,
     .says = "the accelerometers are {} to the right of the middle"},
};

const effect_t effect_imu_lever_arm = {
    .info = {.name = "imu_lever_arm",
             .words = "an accelerometer away from the middle of the axle",
             .summary = "The accelerometers are not at the middle of the axle, so they feel the turning.",
             .mechanism = "sensor",
             .acts_on = "sensor",
             .equation = "accel_surge += -r^2 x - r' y, accel_sway += -r^2 y + r' x",
             .source = "rigid-body kinematics; size effect, Titterton & Weston 2004",
             .prior = BP_PRIOR_COMMON,
             .prior_reason = "A board seldom has room for its accelerometers above the middle of the axle.",
             .advice = "Measure how far the accelerometers are from the middle of the axle, and state it.",
             .parameter_count = 2,
             .parameters = PARAMETERS},
    .hook = {[SITE_SENSOR] = sensor},
};
