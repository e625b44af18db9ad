#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "brickpilot_sim.h"
#include "effects/effect.h"
#include "plant/lanes.h"
#include "sensors/random.h"
#include "unity.h"

/* Runs of random models go side by side and one at a time. Every byte must be the same: all outputs, where a run stopped,
 * why, and the last state. */

enum { TRIALS = 400, RUNS = 11, SAMPLES = 24, RESTARTS = 3 };

typedef struct {
    bp_run run;
    double input[2 * SAMPLES];
    double output[SAMPLES * OUTPUT_COUNT];
    bp_restart restart[RESTARTS];
} given_t;

static random_t random;
static double sample_time[SAMPLES];
static int columns[5];
static given_t alone[RUNS], together[RUNS];
static int seen[6];   /* runs that ended with each status, 0 to -5 */
static int mixed;     /* trials in which one run stopped and others went on */
static int used[128]; /* runs with each effect */

void setUp(void)
{
    random_start(&random, 17);
}
void tearDown(void) {}

static double uniform(double low, double high)
{
    return low + (high - low) * random_uniform(&random);
}

static bool chance(double share)
{
    return random_uniform(&random) < share;
}

static int below(int count)
{
    return (int)uniform(0, count);
}

/* Around the preset, and now and then at an end of the range. */
static double drawn(const bp_parameter_info *info)
{
    const double size = info->preset != 0 ? info->preset : info->maximum < 1 ? info->maximum : 0.1;
    const double value = chance(0.04)   ? info->minimum
                         : chance(0.02) ? info->maximum
                         : chance(0.1)  ? 0
                                        : size * uniform(chance(0.2) ? -1 : 0.3, 2);
    return fmin(fmax(value, info->minimum), info->maximum);
}

static void add_effects(bp_model *model)
{
    const int wanted = chance(0.1) ? below(20) : below(5); /* more than fit into registers, too */
    for (int n = 0; n < wanted; n++) {
        int count = 0;
        while (bp_effect(count) != NULL)
            count++;
        const int index = below(count);
        const bp_effect_info *effect = bp_effect(index);
        double value[BP_MAX_PARAMETERS];
        for (int i = 0; i < effect->parameter_count; i++)
            value[i] = drawn(&effect->parameters[i]);
        used[index] += bp_model_add_effect(model, effect->name, value) == 0;
    }
}

static bp_model *draw_model(int vehicle, int profile)
{
    bp_model *model = bp_model_new(vehicle, profile);
    for (int i = 0; bp_parameter(i) != NULL; i++)
        if (chance(0.3))
            (void)bp_model_set(model, bp_parameter(i)->name, drawn(bp_parameter(i)));
    add_effects(model);
    return model;
}

static void draw_times(void)
{
    const double step = chance(0.5) ? 0.003 : uniform(0.001, 0.02), jitter = chance(0.5) ? 0 : 0.3;
    sample_time[0] = uniform(-1, 1);
    for (int k = 1; k < SAMPLES; k++)
        sample_time[k] = sample_time[k - 1] + step * (1 + jitter * uniform(-1, 1));
    if (chance(0.03))
        sample_time[SAMPLES / 2] = sample_time[SAMPLES / 2 - 1];
}

static double draw_volts(void)
{
    return chance(0.1) ? NAN : chance(0.2) ? 0 : chance(0.002) ? 1e200 : uniform(-9, 9);
}

static bp_state draw_state(double open_share)
{
    double number[sizeof(bp_state) / sizeof(double)];
    for (size_t i = 0; i < sizeof number / sizeof number[0]; i++)
        number[i] = chance(open_share) ? NAN : chance(0.5) ? 0 : uniform(-0.5, 1);
    if (chance(0.02))
        number[below(12)] = INFINITY;
    bp_state state;
    memcpy(&state, number, sizeof state);
    return state;
}

static void draw_run(given_t *given, int vehicle, int profile, double motor_step, double body_step)
{
    bp_run *run = &given->run;
    *run = (bp_run){.model = draw_model(vehicle, profile), .samples = chance(0.05) ? SAMPLES / 2 : SAMPLES};
    run->motor_step = chance(0.1) ? 0.001 : motor_step;
    run->body_step = body_step;
    run->initial = draw_state(0);
    for (int k = 0; k < 2 * SAMPLES; k++)
        given->input[k] = k > 1 && chance(0.7) ? given->input[k - 2] : draw_volts();
    run->columns = chance(0.5) ? columns : NULL;
    run->column_count = 5;
    for (int k = 1 + below(6); k < SAMPLES && run->restart_count < RESTARTS && chance(0.6); k += 1 + below(9))
        given->restart[run->restart_count++] = (bp_restart){.sample = k, .state = draw_state(0.6)};
}

/* Fills in the addresses of a copy, and outputs that nobody has written. */
static void place(given_t *given)
{
    given->run.time = sample_time;
    given->run.input = given->input;
    given->run.output = given->output;
    given->run.restart = given->restart;
    memset(given->output, 0x55, sizeof given->output);
}

static void draw_trial(void)
{
    const int vehicle = chance(0.3) ? BP_MOTOR : chance(0.2) ? BP_SKID_STEER : BP_DIFF_DRIVE;
    const int profile = vehicle != BP_SKID_STEER && chance(0.3) ? BP_PAPER : BP_COUPLED;
    const double body_step = chance(0.3) ? 0.01 : 0, motor_step = chance(0.3) ? body_step : 0;
    draw_times();
    for (int i = 0; i < 5; i++)
        columns[i] = below(OUTPUT_COUNT);
    for (int i = 0; i < RUNS; i++)
        draw_run(&alone[i], vehicle, profile, motor_step, body_step);
}

static void simulate(given_t *given, int threads, int lanes)
{
    bp_run runs[RUNS];
    for (int i = 0; i < RUNS; i++) {
        place(&given[i]);
        runs[i] = given[i].run;
    }
    (void)bp_simulate_lanes(runs, RUNS, threads, lanes);
    for (int i = 0; i < RUNS; i++)
        given[i].run = runs[i];
}

static void describe(const bp_model *model, int trial, int run, int lanes, char *text, size_t size)
{
    int used_size = snprintf(text, size, "trial %d, run %d, %d lanes:", trial, run, lanes);
    for (int i = 0; i < model->effect_count && (size_t)used_size < size; i++)
        used_size += snprintf(text + used_size, size - (size_t)used_size, " %s", model->effect[i].effect->info.name);
}

static void compare(int trial, int lanes)
{
    for (int i = 0; i < RUNS; i++) {
        const given_t *one = &alone[i], *other = &together[i];
        char where[400];
        describe(one->run.model, trial, i, lanes, where, sizeof where);
        TEST_ASSERT_EQUAL_INT_MESSAGE(one->run.status, other->run.status, where);
        TEST_ASSERT_EQUAL_MEMORY_MESSAGE(&one->run.final, &other->run.final, sizeof one->run.final, where);
        TEST_ASSERT_EQUAL_MEMORY_MESSAGE(one->output, other->output, sizeof one->output, where);
    }
}

static void count_statuses(void)
{
    int stopped = 0;
    for (int i = 0; i < RUNS; i++) {
        seen[-alone[i].run.status]++;
        stopped += alone[i].run.status == BP_E_DIVERGED;
    }
    mixed += stopped > 0 && stopped < RUNS;
}

static void test_lanes_give_the_bytes_of_one_run_at_a_time(void)
{
    for (int trial = 0; trial < TRIALS; trial++) {
        draw_trial();
        simulate(alone, 1, 1);
        count_statuses();
        for (int lanes = 2; lanes <= bp_lanes(); lanes *= 2) {
            memcpy(together, alone, sizeof together);
            simulate(together, 1 + trial % 2, lanes);
            compare(trial, lanes);
        }
        for (int i = 0; i < RUNS; i++)
            bp_model_free((bp_model *)alone[i].run.model);
    }
    TEST_ASSERT_GREATER_THAN(TRIALS * RUNS / 2, seen[0]);
    TEST_ASSERT_GREATER_THAN(20, seen[-BP_E_RANGE]);
    TEST_ASSERT_GREATER_THAN(10, seen[-BP_E_TIME]);
    TEST_ASSERT_GREATER_THAN(20, seen[-BP_E_DIVERGED]);
    TEST_ASSERT_GREATER_THAN(10, mixed);
    for (int i = 0; bp_effect(i) != NULL; i++)
        TEST_ASSERT_GREATER_THAN_MESSAGE(10, used[i], bp_effect(i)->name);
}

static void test_lanes_that_the_processor_has_are_2_4_or_8(void)
{
    const int most = bp_lanes();
    TEST_ASSERT_TRUE(most == 2 || most == 4 || most == 8);
    TEST_ASSERT_EQUAL_INT(1, lanes_widest(1));
    TEST_ASSERT_EQUAL_INT(2, lanes_widest(3));
    TEST_ASSERT_EQUAL_INT(most, lanes_widest(100));
}

static void test_lanes_leave_runs_for_every_thread(void)
{
    const int most = bp_lanes();
    TEST_ASSERT_EQUAL_INT(most, lanes_shared(8, 1, 8));
    TEST_ASSERT_EQUAL_INT(2, lanes_shared(8, 4, 8));
    TEST_ASSERT_EQUAL_INT(2, lanes_shared(7, 3, 8));
    TEST_ASSERT_EQUAL_INT(1, lanes_shared(8, 8, 8));
    TEST_ASSERT_EQUAL_INT(1, lanes_shared(3, 64, 8));
    TEST_ASSERT_EQUAL_INT(most, lanes_shared(1000, 8, 8));
    TEST_ASSERT_EQUAL_INT(2, lanes_shared(1000, 8, 2));
    TEST_ASSERT_EQUAL_INT(1, lanes_shared(0, 0, 8));
}

/* What a group does with two plants and three is done in registers, and not one plant at a time. */
static void test_lanes_take_the_narrowest_kernel_that_holds_them(void)
{
    lanes_t *lanes = malloc(sizeof *lanes);
    bp_model *model = bp_model_new(BP_DIFF_DRIVE, BP_COUPLED);
    for (int count = 2; count <= bp_lanes(); count++) {
        for (int i = 0; i < count; i++)
            TEST_ASSERT_EQUAL_INT(0, plant_start(&lanes->plant[i], model, NULL, 0, 0));
        lanes_open(lanes, count);
        TEST_ASSERT_EQUAL_INT(count <= 2 ? 2 : count <= 4 ? 4 : 8, lanes->kernel->width);
        TEST_ASSERT_EQUAL_INT(vehicle_numbers(), lanes->kernel->vehicle_numbers);
    }
    bp_model_free(model);
    free(lanes);
}

static void test_lanes_hold_no_tyres_that_slip(void)
{
    static plant_t plant;
    bp_model *model = bp_model_new(BP_DIFF_DRIVE, BP_COUPLED);
    TEST_ASSERT_EQUAL_INT(0, plant_start(&plant, model, NULL, 0, 0));
    TEST_ASSERT_TRUE(lanes_may_hold(&plant));
    const double value[] = {0.1, 0.6};
    TEST_ASSERT_EQUAL_INT(0, bp_model_add_effect(model, "wheel_slip", value));
    TEST_ASSERT_EQUAL_INT(0, plant_start(&plant, model, NULL, 0, 0));
    TEST_ASSERT_FALSE(lanes_may_hold(&plant));
    bp_model_free(model);
    model = bp_model_new(BP_SKID_STEER, BP_COUPLED);
    TEST_ASSERT_EQUAL_INT(0, plant_start(&plant, model, NULL, 0, 0));
    TEST_ASSERT_FALSE(lanes_may_hold(&plant));
    bp_model_free(model);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_lanes_give_the_bytes_of_one_run_at_a_time);
    RUN_TEST(test_lanes_that_the_processor_has_are_2_4_or_8);
    RUN_TEST(test_lanes_leave_runs_for_every_thread);
    RUN_TEST(test_lanes_take_the_narrowest_kernel_that_holds_them);
    RUN_TEST(test_lanes_hold_no_tyres_that_slip);
    return UNITY_END();
}
