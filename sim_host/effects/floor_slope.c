#include "effects/effect.h"

#include "effects/slope.h"

static void body(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    if (vehicle->vehicle == BP_MOTOR)
        return;
    slope_push(vehicle, slope_pull(vehicle, value[0], value[1], vehicle->middle.heading));
}

static void sensor(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    slope_show(vehicle, slope_pull(vehicle, value[0], value[1], slope_heading(vehicle)));
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
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "Gravity pulls on every slope, but many test floors are level.",
             .advice = "Level the floor, or drive each manoeuvre both ways over it.",
             .parameter_count = 2,
             .parameters = PARAMETERS},
    .hook = {[SITE_BODY] = body, [SITE_SENSOR] = sensor},
};
