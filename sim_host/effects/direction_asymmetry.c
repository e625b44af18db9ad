#include "effects/effect.h"

static void drive(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    for (int k = 0; k < vehicle_wheels(vehicle); k++)
        vehicle->voltage[k] *= 1 + 0.5 * value[2] * real_sign(vehicle->voltage[k]);
}

/* Changes the drag, but not below 0: at 0 one direction has no losses. */
static void motor(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    for (int k = 0; k < vehicle_wheels(vehicle); k++) {
        motor_t *motor = &vehicle->motor[k];
        const real_t change = 0.5 * value[1] * real_sign(vehicle->state.wheel_speed[k]);
        motor->drag = real_most(motor->drag + change, real_of(0));
    }
}

/* Friction in one direction only equals half of it in both directions plus half of it as a constant torque. */
static void wheel(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    for (int k = 0; k < vehicle_wheels(vehicle); k++) {
        vehicle->dry[DRY_LEFT + k] += 0.5 * real_abs(value[0]);
        vehicle->wheel_torque[k] -= 0.5 * value[0];
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "torque",
     .role = BP_ROLE_SIZE,
     .unit = "N m",
     .linear_unit = "N",
     .meaning = "dry friction forward less backward, at each wheel",
     .minimum = -1000,
     .maximum = 1000,
     .preset = 0.006,
     .says = "dry friction is {} larger forward than backward",
     .says_below = "dry friction is {} larger backward than forward"},
    {.name = "drag",
     .role = BP_ROLE_SIZE,
     .unit = "N m s/rad",
     .linear_unit = "N s/m",
     .meaning = "linear losses forward less backward",
     .minimum = -1e5,
     .maximum = 1e5,
     .preset = 0,
     .optional = 1,
     .trial = 5e-4,
     .variation = "in the linear losses",
     .says = "the losses are {} larger forward than backward",
     .says_below = "the losses are {} larger backward than forward"},
    {.name = "gain",
     .role = BP_ROLE_SIZE,
     .unit = "1",
     .meaning = "share of the voltage that arrives, forward less backward",
     .minimum = -2,
     .maximum = 2,
     .preset = 0,
     .optional = 1,
     .trial = 0.1,
     .variation = "in the gain of the drive",
     .mechanism = "drive",
     .says = "the motors get {} more voltage forward than backward",
     .says_below = "the motors get {} more voltage backward than forward"},
};

static void undo(const double *value, bp_undoable *undoable)
{
    for (int k = 0; k < 2; k++) {
        undoable->dry_torque[k] += 0.5 * fabs(value[0]);
        undoable->load[k] += 0.5 * value[0];
    }
}

const effect_t effect_direction_asymmetry = {
    .info = {.name = "direction_asymmetry",
             .words = "a difference between forward and backward",
             .summary = "Friction, losses or the drive's gain differ between forward and backward.",
             .mechanism = "bearing",
             .acts_on = "motor",
             .equation = "forward less backward, at each wheel: dry friction T_f = -torque while w > 0 and none "
                         "backward (a negative torque: the reverse); losses (b + drag / 2) w forward, (b - drag / 2) "
                         "w backward; voltage V (1 + gain / 2) forward, V (1 - gain / 2) backward",
             .source = "friction of its own in each direction: Armstrong-Helouvry et al. 1994, Automatica 30(7); "
                       "Janot, Gautier & Brunot 2019, EMPS benchmark. Beside Coulomb friction `torque` is a constant "
                       "offset; drag and gain are not",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "Brushes off the neutral axis and worn teeth favour one direction on some motors.",
             .advice = "Run each motor both ways without load: worn brushes or a worn gear favour one way.",
             .parameter_count = 3,
             .parameters = PARAMETERS,
             .made_of = "coulomb_friction constant_offset"},
    .hook = {[SITE_DRIVE] = drive, [SITE_MOTOR] = motor, [SITE_WHEEL] = wheel},
    .undo = undo,
};
