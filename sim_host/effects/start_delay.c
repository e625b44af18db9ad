#include "effects/effect.h"

#include <math.h>

/* memory: time since the run's start in s. The step in which the delay ends gets the inputs for its last part only. */
static void timing(const double *value, double *memory, vehicle_t *vehicle)
{
    const double held = (value[0] - memory[0]) / vehicle->step;
    memory[0] += vehicle->step;
    if (held <= 0)
        return;
    for (int k = 0; k < 2; k++) {
        const double command = vehicle->command[k];
        if (held >= 1 || (isnan(command) && held > 0.5))
            vehicle->command[k] = 0;
        else
            vehicle->command[k] = (1 - held) * command; /* NaN stays NaN: a floating motor goes on floating */
    }
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "delay",
     .role = BP_ROLE_SIZE,
     .unit = "s",
     .meaning = "time from the run's start to its first input; later inputs act in time",
     .minimum = 0,
     .maximum = 10,
     .preset = 0.2,
     .run_value = "start"},
};

const effect_t effect_start_delay = {
    .info = {.name = "start_delay",
             .words = "a delay between the start of a recording and that of the drive",
             .summary = "The recording starts before the drive does, so the first inputs of a run act late.",
             .mechanism = "timing",
             .acts_on = "timing",
             .equation = "V(t) = 0 for t < delay, otherwise the command of t; t counts from the run's start",
             .source = "elementary: recorder and drive that are not started by the same signal",
             .prior = BP_PRIOR_RARE,
             .prior_reason = "A recorder that starts before the drive belongs to one set-up, not to the machine.",
             .advice = "Start the recording and the drive by one command, or shift the clock by this time.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .memory_count = 1,
    .hook = {[SITE_TIMING] = timing},
};
