#include "effects/effect.h"

static void wheel(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)memory;
    const double difference = vehicle->vehicle == BP_MOTOR ? 0 : value[1];
    vehicle->wheel_torque[0] -= value[0] + difference;
    vehicle->wheel_torque[1] -= value[0] - difference;
}

static const bp_parameter_info PARAMETERS[] = {
    {"torque", "N m", "constant load against forward motion, each wheel; N where the motor's input commands force",
     -1000, 1000, 0.006, 0},
    {"difference", "N m", "more of it at the left wheel, less at the right one; not for a motor", -1000, 1000, 0, 1},
};

const effect_t effect_constant_offset = {
    .info =
        {.name = "constant_offset",
         .acts_on = "wheel",
         .equation = "T = -(torque + difference) at the left wheel, -(torque - difference) at the right one; -torque "
                     "of a motor; also at rest",
         .source =
             "load offset of the EMPS benchmark: Janot, Gautier & Brunot 2019, Data set and reference models of EMPS",
         .parameter_count = 2,
         .parameters = PARAMETERS},
    .hook = {[SITE_WHEEL] = wheel},
};
