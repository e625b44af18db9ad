/* trace.c: prints a hash of every byte of four flights and an open-loop run. Builds that differ only in optimisation
 * must print the same (tests/gates/test_same_bytes.py). */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "brickpilot_sim.h"

enum { STEPS = 20000, OPEN_LOOP_SAMPLES = 5000 };

static uint64_t fnv1a(const void *bytes, size_t size)
{
    uint64_t hash = 14695981039346656037ULL;
    for (size_t i = 0; i < size; i++)
        hash = (hash ^ ((const unsigned char *)bytes)[i]) * 1099511628211ULL;
    return hash;
}

static int columns(const char *(*name)(int))
{
    int count = 0;
    while (name(count) != NULL)
        count++;
    return count;
}

static int trace_flight(const char *title, int profile, int sensors)
{
    static const double WAYPOINTS[] = {1, 1, 1, -1, 0, -0.5, -1.3, -0.7, 0, 0.2, -0.1, 1.1, -0.3, 1.5, 1.5, -1};
    const size_t size = (size_t)columns(bp_log_name) * STEPS * sizeof(double);
    short *motors = calloc(2 * STEPS, sizeof *motors);
    double *log = calloc(1, size);
    bp_model *model = bp_model_new(BP_DIFF_DRIVE, profile);
    bp_flight flight = {.model = model,
                        .controller = profile,
                        .sensors = sensors,
                        .seed = 7,
                        .steps = STEPS,
                        .start_step = 100,
                        .waypoint_count = 8,
                        .waypoints = WAYPOINTS,
                        .log = log,
                        .motors = motors};
    const int status = bp_fly(&flight);

    printf("%s %d %016" PRIx64 " %016" PRIx64 "\n", title, status, fnv1a(motors, 2 * STEPS * sizeof *motors),
           fnv1a(log, size));
    bp_model_free(model);
    free(log);
    free(motors);
    return status;
}

static int trace_open_loop(void)
{
    const size_t width = (size_t)columns(bp_output_name), size = width * OPEN_LOOP_SAMPLES * sizeof(double);
    const double friction = 0.005;
    double *time = calloc(OPEN_LOOP_SAMPLES, sizeof *time), *input = calloc(2 * OPEN_LOOP_SAMPLES, sizeof *input);
    double *output = calloc(1, size);
    bp_model *model = bp_model_new(BP_DIFF_DRIVE, BP_COUPLED);
    bp_run run = {.model = model, .samples = OPEN_LOOP_SAMPLES, .time = time, .input = input, .output = output};

    for (int i = 0; i < OPEN_LOOP_SAMPLES; i++) {
        time[i] = i * 0.004 + (i % 3) * 0.0005;
        input[2 * i] = (i / 700 % 3 - 1) * 6.0;
        input[2 * i + 1] = i / 900 % 4 == 3 ? NAN : (i / 500 % 3 - 1) * 4.0;
    }
    int status = bp_model_add_effect(model, "coulomb_friction", &friction);
    status = status != 0 ? status : bp_simulate(&run, 1, 1);
    for (size_t i = 0; i < width * OPEN_LOOP_SAMPLES; i++)
        output[i] = isnan(output[i]) ? 0 : output[i]; /* the bits of a NaN are the compiler's choice */
    printf("open_loop %d %016" PRIx64 "\n", status, fnv1a(output, size));
    bp_model_free(model);
    free(output);
    free(input);
    free(time);
    return status;
}

int main(void)
{
    int failed = trace_flight("coupled/ideal", BP_COUPLED, BP_SENSORS_IDEAL);
    failed |= trace_flight("coupled/imu", BP_COUPLED, BP_SENSORS_IMU);
    failed |= trace_flight("coupled/imu+encoders", BP_COUPLED, BP_SENSORS_IMU_ENCODERS);
    failed |= trace_flight("paper/ideal", BP_PAPER, BP_SENSORS_IDEAL);
    return trace_open_loop() | failed ? EXIT_FAILURE : EXIT_SUCCESS;
}
