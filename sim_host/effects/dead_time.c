#include "effects/effect.h"

#include <math.h>

typedef struct {
    double speed[2]; /* rad/s at the start of the last motor step */
} before_t;

static void start(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)value;
    before_t *before = (before_t *)memory;
    for (int k = 0; k < 2; k++)
        before->speed[k] = vehicle->state.wheel_speed[k];
}

/* Where less than the lost voltage is left to drive a current, none flows: the motor feels its back EMF, that of the
 * middle of the step. */
static void drive(const double *value, double *memory, vehicle_t *vehicle)
{
    before_t *before = (before_t *)memory;
    for (int k = 0; k < vehicle_wheels(vehicle); k++) {
        const motor_t *motor = &vehicle->motor[k];
        const double speed = vehicle->state.wheel_speed[k];
        const double middle = speed + 0.5 * (speed - before->speed[k]);
        const double across = vehicle->voltage[k] - motor->emf_constant * middle;
        before->speed[k] = speed;
        if (motor->torque_per_volt > 0)
            continue;
        if (fabs(across) <= value[0])
            vehicle->voltage[k] -= across;
        else
            vehicle->voltage[k] -= copysign(value[0], across); /* a floating motor is NaN and stays so */
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "voltage",
     .role = BP_ROLE_SIZE,
     .unit = "V",
     .meaning = "voltage lost against the current: dead time over period, times the supply, and what the switches drop",
     .minimum = 0,
     .maximum = 100,
     .preset = 0.5},
};

const effect_t effect_dead_time = {
    .info = {.name = "dead_time",
             .words = "a drive that loses voltage against the current",
             .summary = "The drive's switches rest between pulses and drop a voltage, which acts against the motor's "
                        "current.",
             .mechanism = "drive",
             .acts_on = "drive",
             .equation = "V_motor = V - voltage sign(i), with the sign of V - K_e w; no current flows where |V - K_e "
                         "w| <= voltage. Not where the drive closes a current loop, which makes up for it",
             .source = "Jeong & Park 1991, The analysis and compensation of dead-time effects in PWM inverters, IEEE "
                       "Trans. Industrial Electronics 38(2)",
             .parameter_count = 1,
             .parameters = PARAMETERS,
             .variant_of = "actuator_deadband",
             .variation = "against the current"},
    .memory_count = sizeof(before_t) / sizeof(double),
    .hook = {[SITE_START] = start, [SITE_DRIVE] = drive},
};
