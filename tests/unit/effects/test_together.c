/* Effects together: random subsets of the table, with parameters drawn around their presets. */
#include <string.h>

#include "drive.h"
#include "sensors/random.h"

enum { DRAWS = 400 };

static random_t dice;

void setUp(void)
{
    model = NULL;
    random_start(&dice, 20060101);
}
void tearDown(void)
{
    bp_model_free(model);
}

static double uniform(double low, double high)
{
    return low + (high - low) * random_uniform(&dice);
}

/* Draws a third to three times the preset, with either sign where the range has both. Where the preset is 0, a small
 * value. */
static double draw(const bp_parameter_info *parameter)
{
    const double size = parameter->preset == 0 ? uniform(-0.005, 0.005) : parameter->preset * exp(uniform(-1.1, 1.1));
    const double sign = parameter->minimum < 0 && uniform(0, 1) < 0.5 ? -1 : 1;
    return fmin(fmax(sign * size, parameter->minimum), parameter->maximum);
}

/* The composed effect gets a few terms at a time, as discovery uses it: all of them at once make no vehicle. */
static double draw_one(const bp_effect_info *info, int k)
{
    const bp_parameter_info *parameter = &info->parameters[k];
    const int composed = strcmp(info->name, "composed_term") == 0;
    return composed && uniform(0, 1) > 3.0 / info->parameter_count ? parameter->preset : draw(parameter);
}

static void draw_effects(double share)
{
    for (int i = 0; bp_effect(i) != NULL; i++) {
        const bp_effect_info *info = bp_effect(i);
        double values[BP_MAX_PARAMETERS];
        for (int k = 0; k < info->parameter_count; k++)
            values[k] = draw_one(info, k);
        if (uniform(0, 1) < share)
            TEST_ASSERT_EQUAL_INT_MESSAGE(0, bp_model_add_effect(model, info->name, values), info->name);
    }
}

/* Full voltage forward and backward, shorted, floating: each for a tenth of a second. */
static bp_state ride(double row[OUTPUT_COUNT])
{
    static const double LEFT[] = {9, 4, -9, 0, NAN, 9, -5, NAN, 3, 0}, RIGHT[] = {9, -6, 9, 0, 7, -9, -5, NAN, 3, 0};
    start(NULL);
    for (size_t i = 0; i < sizeof LEFT / sizeof LEFT[0]; i++) {
        go(LEFT[i], RIGHT[i], 0.102);
        for (int k = 0; k < OUTPUT_COUNT; k++)
            TEST_ASSERT_FALSE(isinf(out[k]));
    }
    memcpy(row, out, sizeof out);
    return *state();
}

static void assert_tame(const bp_state *end)
{
    TEST_ASSERT_TRUE(fabs(end->surge) < 5 && fabs(end->sway) < 10 && fabs(end->yaw_rate) < 100);
    TEST_ASSERT_TRUE(fabs(end->wheel_speed[0]) < 200 && fabs(end->current[0]) < 5);
}

static void assert_finite_and_repeatable(int kind, int profile, double share)
{
    for (int i = 0; i < DRAWS; i++) {
        double first[OUTPUT_COUNT], again[OUTPUT_COUNT];
        bp_model_free(model);
        model = bp_model_new(kind, profile);
        draw_effects(share);
        const bp_state end = ride(first), same = ride(again);
        TEST_ASSERT_EQUAL_MEMORY(&end, &same, sizeof end);
        TEST_ASSERT_EQUAL_MEMORY(first, again, sizeof first);
        assert_tame(&end);
    }
}

static void test_few_effects_stay_finite_and_repeatable(void)
{
    assert_finite_and_repeatable(BP_DIFF_DRIVE, BP_COUPLED, 0.08);
}

static void test_many_effects_stay_finite_and_repeatable(void)
{
    assert_finite_and_repeatable(BP_DIFF_DRIVE, BP_COUPLED, 0.5);
}

static void test_all_effects_stay_finite_and_repeatable(void)
{
    assert_finite_and_repeatable(BP_DIFF_DRIVE, BP_COUPLED, 1);
}

static void test_the_paper_s_profile_stays_finite_and_repeatable(void)
{
    assert_finite_and_repeatable(BP_DIFF_DRIVE, BP_PAPER, 0.3);
}

static void test_a_motor_stays_finite_and_repeatable(void)
{
    assert_finite_and_repeatable(BP_MOTOR, BP_COUPLED, 0.3);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_few_effects_stay_finite_and_repeatable);
    RUN_TEST(test_many_effects_stay_finite_and_repeatable);
    RUN_TEST(test_all_effects_stay_finite_and_repeatable);
    RUN_TEST(test_the_paper_s_profile_stays_finite_and_repeatable);
    RUN_TEST(test_a_motor_stays_finite_and_repeatable);
    return UNITY_END();
}
