#include "effects/effect.h"

#include <math.h>

static void body(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    if (vehicle->vehicle != BP_MOTOR)
        vehicle->drag_surge += value[0] * vehicle->build.mass * fabs(vehicle->middle.yaw_rate);
}

static const bp_parameter_info PARAMETERS[] = {
    {"coefficient", "1", "force against the motion over side force", 0, 100, 0.4, 0},
};

const effect_t effect_curve_scrub = {
    .info = {.name = "curve_scrub",
             .acts_on = "body",
             .equation =
                 "X = -coefficient m |u r| sign(u): a share of the tyres' side force m u r in a curve. Not for a motor",
             .source = "cornering resistance as the side force's component against the motion, Gillespie 1992, "
                       "Fundamentals of Vehicle Dynamics, with a constant angle",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_BODY] = body},
};
