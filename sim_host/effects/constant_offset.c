#include "effects/effect.h"

static void wheel(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    const real_t difference = vehicle->vehicle == BP_MOTOR ? real_of(0) : value[1];
    vehicle->wheel_torque[0] -= value[0] + difference;
    vehicle->wheel_torque[1] -= value[0] - difference;
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "torque",
     .role = BP_ROLE_SIZE,
     .unit = "N m",
     .linear_unit = "N",
     .meaning = "constant load against forward motion, at each wheel",
     .minimum = -1000,
     .maximum = 1000,
     .preset = 0.006,
     .says = "a constant load of {} holds each wheel back",
     .says_below = "a constant load of {} pushes each wheel forward"},
    {.name = "difference",
     .role = BP_ROLE_SIZE,
     .unit = "N m",
     .meaning = "load added at the left wheel and taken away at the right one; not for a motor",
     .minimum = -1000,
     .maximum = 1000,
     .preset = 0,
     .odd = 1,
     .optional = 1,
     .trial = 0.006,
     .says = "a constant load of {} holds the left wheel back and pushes the right one"},
};

static void undo(const double *value, bp_undoable *undoable)
{
    undoable->load[0] += value[0] + value[1];
    undoable->load[1] += value[0] - value[1];
}

const effect_t effect_constant_offset = {
    .info = {.name = "constant_offset",
             .words = "a constant load or offset",
             .summary = "A constant torque acts on the wheels, at rest as well as in motion.",
             .mechanism = "drive",
             .acts_on = "wheel",
             .equation = "T = -(torque + difference) at the left wheel, -(torque - difference) at the right one; "
                         "-torque of a motor; also at rest",
             .source = "load offset of the EMPS benchmark: Janot, Gautier & Brunot 2019, Data set and reference "
                       "models of EMPS",
             .prior = BP_PRIOR_COMMON,
             .prior_reason = "Nearly every drive has a zero offset, and a cable or a tilt pulls like one.",
             .advice = "Level the floor, and look for a cable or a spring that pulls.",
             .parameter_count = 2,
             .parameters = PARAMETERS},
    .hook = {[SITE_WHEEL] = wheel},
    .undo = undo,
};
