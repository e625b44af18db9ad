#include "effects/delay_line.h"

/* The signals of a robot. A motor has fewer. */
enum { SIGNALS = OUTPUT_BATTERY_VOLTAGE + 1 };

static void sensor(const double *value, double *memory, vehicle_t *vehicle)
{
    const bool motor = vehicle->vehicle == BP_MOTOR;
    double *signal = motor ? &vehicle->output[OUTPUT_BATTERY_VOLTAGE] : vehicle->output;
    const int count = motor ? OUTPUT_FORCE - OUTPUT_BATTERY_VOLTAGE + 1 : SIGNALS;
    delay_signals(memory, signal, count, value[0], vehicle->step);
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "delay",
     .role = BP_ROLE_SIZE,
     .unit = "s",
     .meaning = "delay of every measured signal; until it is over the run's first values hold",
     .minimum = 0,
     .maximum = 0.3,
     .preset = 0.05},
};

const effect_t effect_sensor_delay = {
    .info = {.name = "sensor_delay",
             .words = "a delay of the sensors",
             .summary = "Every sensor shows what was true some time ago.",
             .mechanism = "sensor",
             .acts_on = "sensor",
             .equation = "y(t) = x(t - delay), linear between body steps",
             .source = "dead time, Ljung 1999, System identification",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "Readings wait in buses and queues wherever the log has the clock of the host.",
             .advice = "Stamp each reading with the time at which it was measured, not that at which it was sent.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .memory_count = DELAY_MEMORY(SIGNALS),
    .hook = {[SITE_SENSOR] = sensor},
};
