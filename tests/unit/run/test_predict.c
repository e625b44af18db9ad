#include <math.h>
#include <string.h>

#include "brickpilot_sim.h"
#include "plant/plant.h"
#include "unity.h"

enum { SAMPLES = 200 };

static bp_model *model;
static bp_prediction given;
static double sample_time[SAMPLES], input[2 * SAMPLES], measured[4 * SAMPLES];
static double innovation[4 * SAMPLES], variance[4 * SAMPLES];
static double filtered[SAMPLES * BP_ESTIMATES], smoothed[SAMPLES * BP_ESTIMATES], spread[SAMPLES * BP_ESTIMATES];
static double drifts[4 * SAMPLES], ahead[SAMPLES * OUTPUT_COUNT];
static const double NOISE[] = {0.05, 0.05, 0.02, 0.1};
static const double NO_DRIFT[] = {0, 0, 0, 0}, DRIFT[] = {0, 0, 0.3, 0};
static const int SPEED_ALONE[] = {OUTPUT_SPEED};
static const int DRIVEN[] = {OUTPUT_WHEEL_SPEED_LEFT, OUTPUT_WHEEL_SPEED_RIGHT, OUTPUT_YAW_RATE, OUTPUT_ACCEL_SURGE};

static unsigned long long seed;

static double uniform(void)
{
    seed = seed * 6364136223846793005ULL + 1442695040888963407ULL;
    return ((double)(seed >> 11) + 0.5) / 9007199254740992.0;
}

static double gauss(void)
{
    return sqrt(-2 * log(uniform())) * cos(6.283185307179586 * uniform());
}

static void set(const char *name, double value)
{
    TEST_ASSERT_EQUAL_INT(0, bp_model_set(model, name, value));
}

/* Sample times that are not even, a command that turns round, and no readings yet. */
static void request(int vehicle, int count, const int *outputs)
{
    const int inputs = vehicle == BP_MOTOR ? 1 : 2;
    model = bp_model_new(vehicle, BP_COUPLED);
    for (int k = 0; k < SAMPLES; k++) {
        sample_time[k] = 0.01 * k + 0.003 * (k % 3 == 1);
        for (int i = 0; i < inputs; i++)
            input[k * inputs + i] = (k / 50 % 2 == 0 ? 5 : -4) + i;
        for (int i = 0; i < count; i++)
            measured[k * count + i] = NAN;
    }
    given = (bp_prediction){.run = {.model = model, .samples = SAMPLES, .time = sample_time, .input = input},
                            .measured_count = count,
                            .measured_output = outputs,
                            .measured = measured,
                            .noise = NOISE,
                            .drift = NO_DRIFT,
                            .innovation = innovation,
                            .innovation_variance = variance,
                            .filtered = filtered,
                            .smoothed = smoothed,
                            .smoothed_sd = spread,
                            .smoothed_drift = drifts};
}

/* Readings of a run with white and lasting loads and with noise, by the plant itself. */
static void measure(void)
{
    plant_t plant;
    double load[PUSH_COUNT] = {0}, out[OUTPUT_COUNT];
    const int count = given.measured_count, inputs = model->vehicle == BP_MOTOR ? 1 : 2;
    TEST_ASSERT_EQUAL_INT(0, plant_start(&plant, model, &given.run.initial, 0, 0));
    for (int k = 0; k + 1 < SAMPLES; k++) {
        const double dt = sample_time[k + 1] - sample_time[k];
        double push[PUSH_COUNT];
        for (int i = 0; i < PUSH_COUNT; i++) {
            load[i] += given.walk[i] * sqrt(dt) * gauss();
            push[i] = load[i] + given.white[i] / sqrt(dt) * gauss();
        }
        plant_push(&plant, push);
        const double volts[2] = {input[k * inputs], input[k * inputs + inputs - 1]};
        TEST_ASSERT_EQUAL_INT(0, plant_advance(&plant, volts, dt));
        plant_outputs(&plant, out);
        for (int i = 0; i < count; i++)
            measured[(k + 1) * count + i] = out[given.measured_output[i]] + NOISE[i] * gauss();
    }
}

/* The second equations of a wheel whose current follows at once: w' = -a w + b V + g d, exact between samples. */
typedef struct {
    double a, b, g;
} wheel_t;

static wheel_t linear_motor(void)
{
    set("inductance", 0);
    set("wheel_inertia", 5e-4);
    set("viscous_friction", 1e-4);
    const double resistance = 22, constant = 0.25, inertia = 5e-4;
    set("resistance", resistance);
    set("torque_constant", constant);
    set("emf_constant", constant);
    return (wheel_t){(constant * constant / resistance + 1e-4) / inertia, constant / resistance / inertia, 1 / inertia};
}

void setUp(void)
{
    seed = 7;
}
void tearDown(void)
{
    bp_model_free(model);
    model = NULL;
}

static void test_scalar_wheel_has_the_innovations_and_likelihood_of_the_closed_form(void)
{
    request(BP_MOTOR, 1, SPEED_ALONE);
    const wheel_t wheel = linear_motor();
    given.white[0] = 2e-4;
    given.start_sd[0] = 0.3;
    measure();
    measured[40] = NAN;
    TEST_ASSERT_EQUAL_INT(0, bp_predict(&given));

    double mean = 0, cov = 0.09, likelihood = 0;
    for (int k = 1; k < SAMPLES; k++) {
        const double dt = sample_time[k] - sample_time[k - 1], keep = exp(-wheel.a * dt);
        const double gain = (1 - keep) / wheel.a;
        mean = keep * mean + gain * wheel.b * input[k - 1];
        cov = keep * keep * cov + gain * gain * wheel.g * wheel.g * 4e-8 / dt;
        if (isnan(measured[k])) {
            TEST_ASSERT_TRUE(isnan(innovation[k]));
            continue;
        }
        const double s = cov + 0.05 * 0.05, e = measured[k] - mean;
        TEST_ASSERT_DOUBLE_WITHIN(1e-5, e, innovation[k]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6 * s, s, variance[k]);
        likelihood -= 0.5 * (log(6.283185307179586 * s) + e * e / s);
        mean += cov / s * e;
        cov -= cov / s * cov;
        TEST_ASSERT_DOUBLE_WITHIN(1e-5, mean, filtered[k * BP_ESTIMATES]);
    }
    TEST_ASSERT_EQUAL_INT(SAMPLES - 2, given.innovation_count);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, likelihood, given.log_likelihood);
}

/* The smoother of Rauch, Tung & Striebel for speed and a load that walks, by its own equations. */
static void test_smoothed_states_are_those_of_rauch_tung_and_striebel(void)
{
    request(BP_MOTOR, 1, SPEED_ALONE);
    const wheel_t wheel = linear_motor();
    given.walk[0] = 1e-2;
    given.start_sd[0] = 0.2;
    measure();
    TEST_ASSERT_EQUAL_INT(0, bp_predict(&given));

    static double x[SAMPLES][2], p[SAMPLES][3], before[SAMPLES][2], q[SAMPLES][3];
    double state[2] = {0, 0}, cov[3] = {0.04, 0, 0};
    memcpy(x[0], state, sizeof state);
    memcpy(p[0], cov, sizeof cov);
    for (int k = 1; k < SAMPLES; k++) {
        const double dt = sample_time[k] - sample_time[k - 1], f = exp(-wheel.a * dt), g = (1 - f) / wheel.a;
        const double h = g * wheel.g;
        state[0] = f * state[0] + g * wheel.b * input[k - 1] + h * state[1];
        const double c0 = f * f * cov[0] + 2 * f * h * cov[1] + h * h * cov[2], c1 = f * cov[1] + h * cov[2];
        cov[0] = c0, cov[1] = c1, cov[2] += 1e-4 * dt;
        memcpy(before[k], state, sizeof state);
        memcpy(q[k], cov, sizeof cov);
        const double s = cov[0] + 0.0025, e = measured[k] - state[0], k0 = cov[0] / s, k1 = cov[1] / s;
        state[0] += k0 * e;
        state[1] += k1 * e;
        cov[2] -= k1 * k1 * s, cov[1] -= k0 * k1 * s, cov[0] -= k0 * k0 * s;
        memcpy(x[k], state, sizeof state);
        memcpy(p[k], cov, sizeof cov);
    }
    double later[2] = {x[SAMPLES - 1][0], x[SAMPLES - 1][1]};
    for (int k = SAMPLES - 2; k >= 0; k--) {
        const double dt = sample_time[k + 1] - sample_time[k], f = exp(-wheel.a * dt);
        const double h = (1 - f) / wheel.a * wheel.g;
        const double a0 = p[k][0] * f + p[k][1] * h, a1 = p[k][1]; /* P F' = [a0 a1; b0 b1] */
        const double b0 = p[k][1] * f + p[k][2] * h, b1 = p[k][2];
        const double *n = q[k + 1], scale = 1 / (n[0] * n[2] - n[1] * n[1]);
        const double d0 = later[0] - before[k + 1][0], d1 = later[1] - before[k + 1][1];
        const double i0 = (n[2] * d0 - n[1] * d1) * scale, i1 = (n[0] * d1 - n[1] * d0) * scale;
        later[0] = x[k][0] + a0 * i0 + a1 * i1;
        later[1] = x[k][1] + b0 * i0 + b1 * i1;
        TEST_ASSERT_DOUBLE_WITHIN(1e-4, later[0], smoothed[k * BP_ESTIMATES]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, later[1], smoothed[k * BP_ESTIMATES + 10]);
    }
    TEST_ASSERT_TRUE(spread[100 * BP_ESTIMATES + 10] < sqrt(p[100][2]));
}

static void drive_with_all_noises(void)
{
    request(BP_DIFF_DRIVE, 4, DRIVEN);
    set("drag_area", 0); /* what is left is linear */
    given.decay = 0.3;
    given.drift_decay = 0.5;
    given.drift = DRIFT;
    given.white[0] = 3e-4;
    given.white[3] = 1e-4;
    given.walk[1] = 1e-2;
    given.walk[2] = 0.1;
    measure();
    for (int i = 0; i < BP_LOADS; i++) { /* far from the best values, so that the likelihood is steep */
        given.white[i] *= 4;
        given.walk[i] *= 4;
    }
}

static double likelihood_at(double *size, double value)
{
    *size = value;
    TEST_ASSERT_EQUAL_INT(0, bp_predict(&given));
    return given.log_likelihood;
}

/* A difference over five points, so that it is as exact as the slope. */
static void slope_is(double found, double *size, const char *what)
{
    const double middle = *size, step = 5e-3 * middle;
    const double near = likelihood_at(size, middle + step) - likelihood_at(size, middle - step);
    const double far = likelihood_at(size, middle + 2 * step) - likelihood_at(size, middle - 2 * step);
    const double expected = (8 * near - far) / (12 * step) / (2 * middle); /* along the square of the size */
    *size = middle;
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(2e-3 * fabs(expected) + 1e-6, expected, found, what);
}

static void test_slopes_are_differences_of_the_log_likelihood(void)
{
    double noise[4], drift[4];
    drive_with_all_noises();
    memcpy(noise, NOISE, sizeof noise);
    noise[3] *= 3;
    memcpy(drift, DRIFT, sizeof drift);
    given.noise = noise;
    given.drift = drift;
    TEST_ASSERT_EQUAL_INT(0, bp_predict(&given));
    const bp_prediction found = given;
    slope_is(found.white_slope[0], &given.white[0], "white left");
    slope_is(found.white_slope[3], &given.white[3], "white yaw");
    slope_is(found.walk_slope[1], &given.walk[1], "walk right");
    slope_is(found.walk_slope[2], &given.walk[2], "walk surge");
    slope_is(found.drift_slope[2], &drift[2], "drift");
    slope_is(found.noise_slope[3], &noise[3], "noise");
}

static void test_without_process_noise_the_likelihood_is_that_of_the_free_run(void)
{
    request(BP_DIFF_DRIVE, 4, DRIVEN);
    measure();
    given.run.output = ahead;
    TEST_ASSERT_EQUAL_INT(0, bp_predict(&given));
    for (int k = 1; k < SAMPLES; k++)
        for (int i = 0; i < 4; i++) {
            TEST_ASSERT_DOUBLE_WITHIN(1e-9, measured[4 * k + i] - ahead[k * OUTPUT_COUNT + DRIVEN[i]],
                                      innovation[4 * k + i]);
            TEST_ASSERT_DOUBLE_WITHIN(1e-12, NOISE[i] * NOISE[i], variance[4 * k + i]);
        }
}

static void test_a_horizon_starts_again_from_the_estimate(void)
{
    drive_with_all_noises();
    given.run.output = ahead;
    given.horizon = 0.2;
    TEST_ASSERT_EQUAL_INT(0, bp_predict(&given));
    for (int k = 0; k + 1 < SAMPLES; k++) {
        const bool starts = (int)(sample_time[k] / 0.2 + 1e-9) != (int)(sample_time[k > 0 ? k - 1 : 0] / 0.2 + 1e-9);
        const double gap = fabs(ahead[k * OUTPUT_COUNT + OUTPUT_WHEEL_SPEED_LEFT] - filtered[k * BP_ESTIMATES]);
        TEST_ASSERT_TRUE(gap < 10);
        if (starts) { /* the first step from the estimate leaves out its loads alone */
            const double next = ahead[(k + 1) * OUTPUT_COUNT + OUTPUT_WHEEL_SPEED_LEFT];
            TEST_ASSERT_DOUBLE_WITHIN(1.0, filtered[(k + 1) * BP_ESTIMATES], next);
        }
    }
}

static void test_a_paper_vehicle_tracks_its_body(void)
{
    request(BP_DIFF_DRIVE, 4, DRIVEN);
    bp_model_free(model);
    model = bp_model_new(BP_DIFF_DRIVE, BP_PAPER);
    given.run.model = model;
    given.white[3] = 1e-4;
    given.white[2] = 1e-3;
    measure();
    TEST_ASSERT_EQUAL_INT(0, bp_predict(&given));
    TEST_ASSERT_TRUE(spread[100 * BP_ESTIMATES + 6] > 0);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, measured[4 * 150 + 2], smoothed[150 * BP_ESTIMATES + 6]);
}

static void test_values_outside_their_range_and_outputs_that_are_absent_are_refused(void)
{
    const double none[] = {0, 0, 0, 0};
    request(BP_DIFF_DRIVE, 4, DRIVEN);
    given.noise = none;
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_predict(&given));
    given.noise = NOISE;
    given.white[1] = -1;
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_predict(&given));
    given.white[1] = 0;
    given.measured_output = (const int[]){OUTPUT_SPEED, 0, 0, 0};
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_predict(&given));
    given.measured_output = DRIVEN;
    TEST_ASSERT_EQUAL_INT(0, bp_predict(&given));
    TEST_ASSERT_EQUAL_INT(0, given.innovation_count);
}

static void test_a_name_stands_for_each_estimate(void)
{
    TEST_ASSERT_EQUAL_STRING("wheel_speed_left", bp_estimate_name(0));
    TEST_ASSERT_EQUAL_STRING("moment_yaw", bp_estimate_name(BP_ESTIMATES - 1));
    TEST_ASSERT_EQUAL_STRING("N m", bp_estimate_unit(BP_ESTIMATES - 1));
    TEST_ASSERT_NULL(bp_estimate_name(BP_ESTIMATES));
    TEST_ASSERT_NULL(bp_estimate_unit(-1));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_scalar_wheel_has_the_innovations_and_likelihood_of_the_closed_form);
    RUN_TEST(test_smoothed_states_are_those_of_rauch_tung_and_striebel);
    RUN_TEST(test_slopes_are_differences_of_the_log_likelihood);
    RUN_TEST(test_without_process_noise_the_likelihood_is_that_of_the_free_run);
    RUN_TEST(test_a_horizon_starts_again_from_the_estimate);
    RUN_TEST(test_a_paper_vehicle_tracks_its_body);
    RUN_TEST(test_values_outside_their_range_and_outputs_that_are_absent_are_refused);
    RUN_TEST(test_a_name_stands_for_each_estimate);
    return UNITY_END();
}
