#include "effects/effect.h"

static void build(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    if (vehicle->vehicle == BP_MOTOR)
        return;
    vehicle->build.rim[0] *= 1 + 0.5 * value[0];
    vehicle->build.rim[1] *= 1 - 0.5 * value[0];
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "mismatch",
     .role = BP_ROLE_SIZE,
     .unit = "1",
     .meaning = "left radius less right radius, over their mean",
     .minimum = -1,
     .maximum = 1,
     .preset = 0.05,
     .odd = 1,
     .says = "the right wheel is {} smaller than the left",
     .over_mean = 1},
};

static void undo(const double *value, bp_undoable *undoable)
{
    undoable->rim[0] *= 1 + 0.5 * value[0];
    undoable->rim[1] *= 1 - 0.5 * value[0];
}

const effect_t effect_wheel_radius_mismatch = {
    .info = {.name = "wheel_radius_mismatch",
             .words = "a difference between the left and the right wheel's radius",
             .summary = "One wheel is larger than the other, so the vehicle drives a curve when both turn alike.",
             .mechanism = "tyre",
             .acts_on = "wheel",
             .equation = "left wheel's radius r_w (1 + mismatch / 2), right wheel's r_w (1 - mismatch / 2); "
                         "wheel_travel and wheel_velocity stay those of r_w, which is what odometry assumes. Not for "
                         "a motor",
             .source = "unequal wheel diameters: Borenstein & Feng 1996, Measurement and correction of systematic "
                       "odometry errors in mobile robots, IEEE Trans. Robotics and Automation 12(6)",
             .prior = BP_PRIOR_COMMON,
             .prior_reason = "Cheap tyres have tolerances and bear unequal loads, so their rolling radii differ.",
             .advice = "Measure both wheels under load: change a worn or soft tyre, or give each wheel its own radius.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_BUILD] = build},
    .undo = undo,
};
