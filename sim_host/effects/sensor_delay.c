#include "effects/delay_line.h"

/* The signals of a robot. A motor has fewer. */
enum { SIGNALS = OUTPUT_BATTERY_VOLTAGE + 1, AXES = 2 };

static const int ACCELERATION[AXES] = {OUTPUT_ACCEL_SURGE, OUTPUT_ACCEL_SWAY};

/* An accelerometer's reading is a mean over a step. Steps may differ in length, so its integral is delayed. */
typedef struct {
    double first;   /* m/s^2: the first reading, which holds before the run, too */
    double sum;     /* m/s: the integral of the readings since the run's start */
    double delayed; /* m/s: the integral at the end of the last step, delayed */
} integral_t;

typedef struct {
    double started;
    integral_t integral[AXES];
} means_t;

enum { MEANS_MEMORY = sizeof(means_t) / sizeof(double) };

static void begin(means_t *means, const double *signal, double delay)
{
    for (int k = 0; k < AXES; k++) {
        const double first = signal[ACCELERATION[k]];
        means->integral[k] = (integral_t){.first = first, .delayed = -first * delay};
    }
    means->started = 1;
}

/* Replaces each acceleration by its integral at the end of the step. */
static void sum_up(means_t *means, double *signal, double step)
{
    for (int k = 0; k < AXES; k++) {
        integral_t *integral = &means->integral[k];
        integral->sum += step * signal[ACCELERATION[k]];
        signal[ACCELERATION[k]] = integral->sum;
    }
}

/* Replaces each delayed integral by its mean slope in the step. `time`: s from the run's start to what is shown now. A
 * step of 0 s, before the run, shows the first reading. */
static void differentiate(means_t *means, double *signal, double time, double step)
{
    for (int k = 0; k < AXES; k++) {
        integral_t *integral = &means->integral[k];
        const double delayed = time < 0 ? integral->first * time : signal[ACCELERATION[k]];
        signal[ACCELERATION[k]] = step > 0 ? (delayed - integral->delayed) / step : integral->first;
        integral->delayed = delayed;
    }
}

static void sensor(const double *value, double *memory, vehicle_t *vehicle)
{
    const double delay = value[0], step = vehicle->step;
    if (delay <= 0)
        return;
    means_t *means = (means_t *)memory;
    delay_line_t *line = (delay_line_t *)(memory + MEANS_MEMORY);
    if (vehicle->vehicle == BP_MOTOR) {
        const int count = OUTPUT_FORCE - OUTPUT_BATTERY_VOLTAGE + 1;
        delay_signals((double *)line, &vehicle->output[OUTPUT_BATTERY_VOLTAGE], count, delay, step);
        return;
    }
    double *signal = vehicle->output;
    if (means->started == 0)
        begin(means, signal, delay);
    sum_up(means, signal, step);
    delay_signals((double *)line, signal, SIGNALS, delay, step);
    differentiate(means, signal, line->time - delay, step);
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
             .equation = "y(t) = x(t - delay), linear between body steps; accelerations by their integral",
             .source = "dead time, Ljung 1999, System identification",
             .prior = BP_PRIOR_USUAL,
             .prior_reason = "Readings wait in buses and queues wherever the log has the clock of the host.",
             .advice = "Stamp each reading with the time at which it was measured, not that at which it was sent.",
             .parameter_count = 1,
             .parameters = PARAMETERS},
    .memory_count = MEANS_MEMORY + DELAY_MEMORY(SIGNALS),
    .hook = {[SITE_SENSOR] = sensor},
};
