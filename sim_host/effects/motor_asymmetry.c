#include "effects/effect.h"

/* This is a gain of the drive, not of the motor. It scales V, and so stall torque and speed alike. A difference of the
 * motors is torque_constant_asymmetry: it scales K_t V by 1 + c and K_t K_e by (1 + c)^2, which gives more torque and
 * less speed. Any run with a start and a steady speed distinguishes the two effects. A BP_MOTOR has no other side. */
static void drive(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    if (vehicle->vehicle == BP_MOTOR)
        return;
    vehicle->voltage[0] *= 1 + 0.5 * value[0];
    vehicle->voltage[1] *= 1 - 0.5 * value[0];
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "difference",
     .role = BP_ROLE_SIZE,
     .unit = "1",
     .meaning = "voltage gain of the left drive less that of the right; their mean is 1",
     .minimum = -1,
     .maximum = 1,
     .preset = 0.1,
     .odd = 1,
     .says = "the right motor is {} weaker than the left",
     .over_mean = 1},
};

static void undo(const double *value, bp_undoable *undoable)
{
    undoable->drive_gain[0] *= 1 + 0.5 * value[0];
    undoable->drive_gain[1] *= 1 - 0.5 * value[0];
}

const effect_t effect_motor_asymmetry = {
    .info = {.name = "motor_asymmetry",
             .words = "a difference between the left and the right drive",
             .summary = "One drive gives its motor a larger share of the commanded voltage than the other.",
             .mechanism = "drive",
             .acts_on = "drive",
             .equation = "V_left = (1 + difference / 2) V, V_right = (1 - difference / 2) V. It does nothing on a "
                         "single motor",
             .source = "eq. 12 with a gain for each drive",
             .prior = BP_PRIOR_COMMON,
             .prior_reason = "No two cheap drives have the same gain.",
             .advice = "Swap the plugs of both motors: if the right side stays weak, look at the right driver and its "
                       "leads; if the left side becomes weak, at the right motor.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .hook = {[SITE_DRIVE] = drive},
    .undo = undo,
};
