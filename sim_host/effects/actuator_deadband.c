#include "effects/effect.h"

static void drive(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)memory;
    for (int k = 0; k < 2; k++) {
        const real_t voltage = vehicle->voltage[k];
        const real_t beyond = real_abs(voltage) - value[0];
        const real_t arrives = choose(value[1] < 0.5, real_signed(beyond, voltage), voltage);
        const real_t driven = choose(beyond > 0, arrives, voltage); /* a floating motor is NaN and stays so */
        vehicle->voltage[k] = choose(beyond <= 0, real_of(0), driven);
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "voltage",
     .role = BP_ROLE_SIZE,
     .unit = "V",
     .meaning = "half the width of the dead band, the same for each motor",
     .minimum = 0,
     .maximum = 100,
     .preset = 0.5},
    {.name = "whole",
     .role = BP_ROLE_SWITCH,
     .unit = "1",
     .meaning = "0: the band is missing from larger commands too; 1: they arrive whole",
     .minimum = 0,
     .maximum = 1,
     .preset = 0,
     .variation = "larger commands arrive whole"},
};

static void undo(const double *value, bp_undoable *undoable)
{
    undoable->lost_voltage += value[1] < 0.5 ? value[0] : 0;
}

const effect_t effect_actuator_deadband = {
    .info = {.name = "actuator_deadband",
             .words = "a dead band of the drive around zero volts",
             .summary =
                 "The drive does nothing for small commands, and mostly gives less than commanded for larger ones.",
             .mechanism = "drive",
             .acts_on = "drive",
             .equation = "V_motor = 0 for |V| <= voltage, otherwise V - sign(V) voltage, or V where whole is 1",
             .source = "Tao & Kokotovic 1994, Adaptive control of plants with unknown dead-zones",
             .prior = BP_PRIOR_COMMON,
             .prior_reason = "Nearly every cheap drive needs a least duty before a current flows.",
             .advice = "Start each motor's PWM above the dead band: add this voltage to every command that is not 0.",
             .parameter_count = 2,
             .parameters = PARAMETERS},
    .hook = {[SITE_DRIVE] = drive},
    .undo = undo,
};
