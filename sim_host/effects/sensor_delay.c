#include "effects/delay_line.h"

/* The signals of a robot. A motor has fewer. */
enum { SIGNALS = OUTPUT_BATTERY_VOLTAGE + 1 };

/* An accelerometer's reading is a mean over a step, and steps differ in length. So this effect delays the integral of
 * the readings since the run's start: a speed in m/s. */
typedef struct {
    double first;   /* the first reading, m/s^2; also valid for the time before the run */
    double speed;   /* present integral */
    double delayed; /* delayed integral at the end of the last step */
} accel_sum_t;

typedef struct {
    double started;
    double time; /* s since the run's start */
    accel_sum_t surge;
    accel_sum_t sway;
} sums_t;

enum { SUMS_MEMORY = sizeof(sums_t) / sizeof(double) };

/* Replaces a reading by the integral of the readings. */
static void sum_up(accel_sum_t *sum, double *reading, double step)
{
    sum->speed += step * *reading;
    *reading = sum->speed;
}

/* Replaces a delayed integral by its mean slope in the step. `time`: the time, in s since the run's start, that the
 * sensor shows now. A step of 0 s, before the run, shows the first reading. */
static void differentiate(accel_sum_t *sum, double *reading, double time, double step)
{
    const double delayed = time < 0 ? sum->first * time : *reading;
    *reading = step > 0 ? (delayed - sum->delayed) / step : sum->first;
    sum->delayed = delayed;
}

static void delay_robot(sums_t *sums, double *line, double *signal, double delay, double step)
{
    double *surge = &signal[OUTPUT_ACCEL_SURGE];
    double *sway = &signal[OUTPUT_ACCEL_SWAY];
    if (sums->started == 0) {
        sums->surge = (accel_sum_t){.first = *surge, .delayed = -delay * *surge};
        sums->sway = (accel_sum_t){.first = *sway, .delayed = -delay * *sway};
        sums->started = 1;
    }
    sums->time += step;
    sum_up(&sums->surge, surge, step);
    sum_up(&sums->sway, sway, step);
    delay_signals(line, signal, SIGNALS, delay, step);
    differentiate(&sums->surge, surge, sums->time - delay, step);
    differentiate(&sums->sway, sway, sums->time - delay, step);
}

static void sensor(const double *value, double *memory, vehicle_t *vehicle)
{
    const double delay = value[0];
    const bool motor = vehicle->vehicle == BP_MOTOR;
    double *line = &memory[SUMS_MEMORY];
    if (motor)
        delay_signals(line, &vehicle->output[OUTPUT_BATTERY_VOLTAGE], OUTPUT_FORCE - OUTPUT_BATTERY_VOLTAGE + 1, delay,
                      vehicle->step);
    else if (delay > 0)
        delay_robot((sums_t *)memory, line, vehicle->output, delay, vehicle->step);
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
    .memory_count = SUMS_MEMORY + DELAY_MEMORY(SIGNALS),
    .hook = {[SITE_SENSOR] = sensor},
};
