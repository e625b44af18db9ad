#include "effects/effect.h"

/* K_t and K_e come from one magnetic flux, so they differ together. If L / R is short, a difference of K_t
 * alone would look like a difference of 1 / R. A BP_MOTOR has no other side. */
static void motor(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    if (vehicle->vehicle == BP_MOTOR)
        return;
    for (int k = 0; k < 2; k++) {
        const real_t flux = 1 + (k == 0 ? 0.5 : -0.5) * value[0];
        vehicle->motor[k].torque_constant *= flux;
        vehicle->motor[k].emf_constant *= flux;
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "difference",
     .role = BP_ROLE_SIZE,
     .unit = "1",
     .meaning = "K_t and K_e of the left motor less those of the right, over their mean",
     .minimum = -1,
     .maximum = 1,
     .preset = 0.1,
     .odd = 1,
     .says = "the right motor's magnet is {} weaker than the left one's",
     .over_mean = 1},
};

static void undo(const double *value, bp_undoable *undoable)
{
    undoable->flux[0] *= 1 + 0.5 * value[0];
    undoable->flux[1] *= 1 - 0.5 * value[0];
}

const effect_t effect_torque_constant_asymmetry = {
    .info = {.name = "torque_constant_asymmetry",
             .words = "a difference between the left and the right motor's torque constant",
             .summary = "One motor has a stronger magnet: it gives more torque per ampere and reaches less speed per "
                        "volt.",
             .mechanism = "motor",
             .acts_on = "motor",
             .equation = "K_t and K_e of the left motor times 1 + difference / 2, of the right motor times 1 - "
                         "difference / 2. It does nothing on a single motor",
             .source = "K_t and K_e are one flux: Hughes & Drury 2019, Electric Motors and Drives, ch. 3; eq. 12",
             .prior = BP_PRIOR_RARE,
             .prior_reason = "Magnets of one batch have nearly the same flux, and gains of drives differ more.",
             .advice = "Swap both motors: if the weak side changes with them, replace the weak one.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_MOTOR] = motor},
    .undo = undo,
};
