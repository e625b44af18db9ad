/* The promise of the `odd` flags of the table: after swapping left and right and the signs of the odd parameters, a run
 * is the mirror image of the first. It holds for every effect at its preset, or near 0 where the preset is 0. */
#include <string.h>

#include "drive.h"

void setUp(void)
{
    model = NULL;
}
void tearDown(void)
{
    bp_model_free(model);
}

static void use(const bp_effect_info *info, int mirrored)
{
    double values[BP_MAX_PARAMETERS];
    for (int k = 0; k < info->parameter_count; k++) {
        const bp_parameter_info *parameter = &info->parameters[k];
        values[k] = parameter->preset == 0 ? fmin(0.01, 0.1 * parameter->maximum) : parameter->preset;
        if (parameter->odd && mirrored)
            values[k] = -values[k];
    }
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, bp_model_add_effect(model, info->name, values), info->name);
}

static void drive(int mirrored, double left, double right, double seconds)
{
    if (mirrored)
        go(right, left, seconds);
    else
        go(left, right, seconds);
}

static void fly(const bp_effect_info *info, int profile, int mirrored, double row[OUTPUT_COUNT])
{
    bp_model_free(model);
    model = bp_model_new(BP_DIFF_DRIVE, profile);
    use(info, mirrored);
    start(NULL);
    drive(mirrored, 7, 4, 0.4);
    drive(mirrored, -3, 6, 0.4);
    drive(mirrored, NAN, -5, 0.2);
    memcpy(row, out, sizeof out);
}

static void assert_mirrored(const char *name, const double a[OUTPUT_COUNT], const double b[OUTPUT_COUNT])
{
    static const output_t EVEN[] = {OUTPUT_ACCEL_SURGE, OUTPUT_X, OUTPUT_SURGE, OUTPUT_BATTERY_VOLTAGE};
    static const output_t ODD[] = {OUTPUT_ACCEL_SWAY, OUTPUT_YAW_RATE, OUTPUT_YAW_ANGLE, OUTPUT_Y, OUTPUT_SWAY};
    static const output_t PAIR[] = {OUTPUT_WHEEL_SPEED_LEFT, OUTPUT_WHEEL_ANGLE_LEFT, OUTPUT_CURRENT_LEFT};
    for (size_t i = 0; i < sizeof EVEN / sizeof EVEN[0]; i++)
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-8 * (1 + fabs(a[EVEN[i]])), a[EVEN[i]], b[EVEN[i]], name);
    for (size_t i = 0; i < sizeof ODD / sizeof ODD[0]; i++)
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-8 * (1 + fabs(a[ODD[i]])), a[ODD[i]], -b[ODD[i]], name);
    for (size_t i = 0; i < sizeof PAIR / sizeof PAIR[0]; i++)
        for (int k = 0; k < 2; k++) {
            const double expected = a[PAIR[i] + (output_t)k], found = b[PAIR[i] + (output_t)(1 - k)];
            TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-8 * (1 + fabs(expected)), expected, found, name);
        }
}

static void assert_profile(int profile)
{
    for (int i = 0; bp_effect(i) != NULL; i++) {
        double here[OUTPUT_COUNT], there[OUTPUT_COUNT];
        fly(bp_effect(i), profile, 0, here);
        fly(bp_effect(i), profile, 1, there);
        assert_mirrored(bp_effect(i)->name, here, there);
    }
}

static void test_odd_parameters_mirror_the_coupled_vehicle(void)
{
    assert_profile(BP_COUPLED);
}

static void test_odd_parameters_mirror_the_paper_s_vehicle(void)
{
    assert_profile(BP_PAPER);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_odd_parameters_mirror_the_coupled_vehicle);
    RUN_TEST(test_odd_parameters_mirror_the_paper_s_vehicle);
    return UNITY_END();
}
