#include "effects/effect.h"

static void body(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    if (vehicle->vehicle != BP_MOTOR)
        vehicle->drag_surge += value[0] * vehicle->build.mass * real_abs(vehicle->middle.yaw_rate);
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "coefficient",
     .role = BP_ROLE_SIZE,
     .unit = "1",
     .meaning = "force against the motion over side force",
     .minimum = 0,
     .maximum = 100,
     .preset = 0.4},
};

const effect_t effect_curve_scrub = {
    .info = {.name = "curve_scrub",
             .words = "tyres that scrub in curves",
             .summary = "In a curve the tyres' side force has a part that slows the vehicle.",
             .mechanism = "tyre",
             .acts_on = "body",
             .equation = "X = -coefficient m |u r| sign(u): a share of the tyres' side force m u r in a curve. Not "
                         "for a motor",
             .source = "cornering resistance as the side force's component against the motion, Gillespie 1992, "
                       "Fundamentals of Vehicle Dynamics, with a constant angle",
             .prior = BP_PRIOR_RARE,
             .prior_reason = "Side forces are small at the lateral acceleration of a slow robot.",
             .advice = "Use narrower or harder tyres, or drive wider curves.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_BODY] = body},
};
