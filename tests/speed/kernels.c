/* kernels.c: the work whose instructions tests/speed/counts.py counts under callgrind. `speed_kernels NAME` does that of one name, always
 * the same; without a name it prints the compiler and what of the processor
 * the counts depend on.
 *
 * Nothing of it depends on time or on the machine. What is counted is a function of the plant or of the firmware that the kernel calls, so
 * what a kernel does before does not count.
 */
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "brickpilot_sim.h"
#include "plant/plant.h"

#ifdef __clang__
#define COMPILER __VERSION__
#else
#define COMPILER "gcc " __VERSION__
#endif

/* Several runs at a time take fewer instructions where the processor has wide registers. Those of 8 numbers do not work under valgrind. */
#if defined __x86_64__
#define WIDE_LANES __builtin_cpu_supports("avx2")
#else
#define WIDE_LANES 0
#endif

enum { STEPS = 400, SAMPLES = 200, RUNS = 8 };

/* From the start of a mission: at rest, a turn on the spot, and a drive. */
static int fly(void)
{
    static const double WAYPOINTS[] = {0.5, 0.5, 0.5, -1};
    bp_model *const model = bp_model_new(BP_DIFF_DRIVE, BP_COUPLED);
    bp_flight flight = {.model = model,
                        .controller = BP_COUPLED,
                        .sensors = BP_SENSORS_IMU_ENCODERS,
                        .seed = 7,
                        .steps = STEPS,
                        .start_step = 10,
                        .waypoint_count = 2,
                        .waypoints = WAYPOINTS};
    const int status = bp_fly(&flight);

    bp_model_free(model);
    return status;
}

static bp_model *with_effects(bp_model *model)
{
    static const double FRICTION = 0.005, SAG = 2.0;
    const int status =
        bp_model_add_effect(model, "coulomb_friction", &FRICTION) | bp_model_add_effect(model, "battery_sag", &SAG);

    return status == 0 ? model : NULL;
}

/* Body steps of 3 ms, each of as many motor steps as fit. */
static int advance(bp_model *model, double motor_step)
{
    static plant_t plant;
    int status = model == NULL ? BP_E_NAME : plant_start(&plant, model, NULL, motor_step, 0.003);

    for (int k = 0; k < STEPS && status == 0; k++) {
        const double input[2] = {k / 40 % 2 == 0 ? 6 : -3, 4};
        status = plant_advance(&plant, input, 0.003);
    }
    return status;
}

static void inputs(double *time, double *input)
{
    for (int k = 0; k < SAMPLES; k++) {
        time[k] = 0.01 * k;
        input[2 * k] = k / 50 % 2 == 0 ? 5 : -4;
        input[2 * k + 1] = 4;
    }
}

/* Robots whose mass differs, in one call and one thread. */
static int simulate(int count, bool effects)
{
    static double time[SAMPLES], input[2 * SAMPLES], output[RUNS][SAMPLES * OUTPUT_COUNT];
    bp_run runs[RUNS];
    int status = 0;

    inputs(time, input);
    for (int i = 0; i < count; i++) {
        bp_model *model = bp_model_new(BP_DIFF_DRIVE, BP_COUPLED);
        if (effects)
            model = with_effects(model);
        status |= bp_model_set(model, "mass", 0.9 + 0.01 * i);
        runs[i] = (bp_run){.model = model, .samples = SAMPLES, .time = time, .input = input, .output = output[i]};
    }
    return status | bp_simulate(runs, count, 1);
}

static int kernel(const char *name)
{
    if (strcmp(name, "fly") == 0)
        return fly();
    if (strcmp(name, "body_of_1") == 0)
        return advance(bp_model_new(BP_DIFF_DRIVE, BP_COUPLED), 0.003);
    if (strcmp(name, "body_of_10") == 0)
        return advance(bp_model_new(BP_DIFF_DRIVE, BP_COUPLED), 0.0003);
    if (strcmp(name, "effects_of_10") == 0)
        return advance(with_effects(bp_model_new(BP_DIFF_DRIVE, BP_COUPLED)), 0.0003);
    if (strcmp(name, "simulate_1") == 0)
        return simulate(1, false);
    if (strcmp(name, "simulate_8") == 0)
        return simulate(RUNS, false);
    if (strcmp(name, "simulate_8_effects") == 0)
        return simulate(RUNS, true);
    return BP_E_NAME;
}

int main(int argc, char **argv)
{
    if (argc == 1) {
        printf("%s%s\n", COMPILER, WIDE_LANES ? ", eight runs in AVX2" : "");
        return EXIT_SUCCESS;
    }
    return kernel(argv[1]) == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
