#include "effects/effect.h"

/* At rest the full friction may oppose surge or yaw, since no direction of sliding divides it between the two. */
static void wheel(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    const real_t along = vehicle->middle.surge, across = vehicle->middle.yaw_rate * value[1];
    const real_t speed = real_hypot(along, across);
    if (vehicle->vehicle == BP_MOTOR)
        return;
    vehicle->dry[DRY_SURGE] += value[0] * choose(speed > 0, real_abs(along) / speed, real_of(1));
    vehicle->dry[DRY_YAW] += value[0] * real_abs(value[1]) * choose(speed > 0, real_abs(across) / speed, real_of(1));
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "force",
     .role = BP_ROLE_SIZE,
     .unit = "N",
     .meaning = "friction of the ball",
     .minimum = 0,
     .maximum = 1e4,
     .preset = 0.25},
    {.name = "forward",
     .role = BP_ROLE_PLACE,
     .unit = "m",
     .meaning = "where the ball touches the floor, ahead of the axle; negative: behind",
     .minimum = -10,
     .maximum = 10,
     .preset = -0.08},
};

const effect_t effect_caster_drag = {
    .info = {.name = "caster_drag",
             .words = "the friction of a caster that is dragged along",
             .summary = "A ball or skid under the vehicle slides over the floor with dry friction.",
             .mechanism = "tyre",
             .acts_on = "body",
             .equation = "dry friction of a sliding ball at (forward, 0) from the axle's middle, against its velocity "
                         "(u, r forward): X = -force u / s, N = -force forward^2 r / s, s = |(u, r forward)|; at rest "
                         "it holds. The tyres take its side force. Not for a motor",
             .source = "Coulomb friction against the sliding velocity, Moreau 1988; castor ball of a differential "
                       "drive: Siegwart, Nourbakhsh & Scaramuzza 2011, ch. 2 and 3",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "Many robots slide on a ball or skid, and others roll on a free caster.",
             .advice = "Clean and oil the caster, or put in a smoother one.",
             .parameter_count = 2,
             .parameters = PARAMETERS},
    .hook = {[SITE_WHEEL] = wheel},
};
