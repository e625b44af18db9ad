#include "effects/effect.h"

static void wheel(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    if (vehicle->vehicle != BP_MOTOR)
        vehicle->dry[DRY_SURGE] += 0.5 * real_hypot(value[0], value[1]);
}

static void body(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    real_t cosine, sine;
    real_turn(vehicle->middle.heading, &cosine, &sine);
    if (vehicle->vehicle == BP_MOTOR)
        return;
    vehicle->force_surge += 0.5 * (value[0] * cosine + value[1] * sine);
    vehicle->force_sway += 0.5 * (value[1] * cosine - value[0] * sine);
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "force_x",
     .role = BP_ROLE_SIZE,
     .unit = "N",
     .meaning = "lean of the pile along the earth's x axis, where heading 0 points",
     .minimum = -1e4,
     .maximum = 1e4,
     .preset = 0.5},
    {.name = "force_y",
     .role = BP_ROLE_SIZE,
     .unit = "N",
     .meaning = "lean of the pile along the earth's y axis, to the right of that",
     .minimum = -1e4,
     .maximum = 1e4,
     .preset = 0.3,
     .odd = 1},
};

const effect_t effect_carpet_nap = {
    .info = {.name = "carpet_nap",
             .words = "the lean of a carpet's pile",
             .summary = "A carpet whose pile leans one way slows the vehicle against the pile and not along it.",
             .mechanism = "floor",
             .acts_on = "body",
             .equation = "pile that leans towards d = (force_x, force_y) / F, F = |(force_x, force_y)|: force -F/2 "
                         "(direction of motion - d). So it costs nothing along d and F against it, and pulls towards "
                         "d across it; at rest it holds. Not for a motor",
             .source = "a passive force with one easy direction; carpet drift of a robot along the pile: Gutmann, "
                       "Eade, Fong & Munich 2012, Vector field SLAM, IEEE T-RO 28(3)",
             .prior = BP_PRIOR_RARE,
             .prior_reason = "Few robots drive on a carpet whose pile leans.",
             .advice = "Drive on a smooth floor, or each manoeuvre both ways over the carpet.",
             .parameter_count = 2,
             .parameters = PARAMETERS},
    .hook = {[SITE_WHEEL] = wheel, [SITE_BODY] = body},
};
