#include <math.h>
#include <string.h>

#include "plant/plant.h"
#include "unity.h"

static const double BAND[] = {0.8, 0};

static bp_model *banded, *plain;

void setUp(void)
{
    plain = bp_model_new(BP_DIFF_DRIVE, BP_COUPLED);
    banded = bp_model_copy(plain);
    bp_model_add_effect(banded, "actuator_deadband", BAND);
}
void tearDown(void)
{
    bp_model_free(plain);
    bp_model_free(banded);
}

static bp_state run(const bp_model *model, double left, double right)
{
    static const bp_state MOVING = {.surge = 0.2, .yaw_rate = 0.5};
    const double input[2] = {left, right};
    plant_t plant;
    plant_start(&plant, model, &MOVING, 0, 0);
    plant_advance(&plant, input, 0.3);
    return plant.vehicle.state;
}

static void assert_same(bp_state a, bp_state b)
{
    TEST_ASSERT_EQUAL_MEMORY(&a, &b, sizeof a);
}

static void test_within_the_band_a_motor_is_shorted(void)
{
    assert_same(run(plain, 0, 0), run(banded, 0.8, -0.8));
    assert_same(run(plain, 0, 0), run(banded, -0.4, 0));
}

static void test_beyond_the_band_the_offset_is_missing(void)
{
    assert_same(run(plain, 5 - 0.8, -3 + 0.8), run(banded, 5, -3));
}

static void test_beyond_the_band_the_whole_command_arrives_where_that_is_switched_on(void)
{
    const double whole[] = {0.8, 1};
    bp_model_add_effect(banded, "actuator_deadband", whole);
    assert_same(run(plain, 5, -3), run(banded, 5, -3));
    assert_same(run(plain, 0, 0), run(banded, 0.8, -0.7));
}

static void test_only_what_is_lost_can_be_undone(void)
{
    const double whole[] = {0.8, 1};
    bp_undoable found;
    bp_model_undoable(banded, &found);
    TEST_ASSERT_EQUAL_DOUBLE(0.8, found.lost_voltage);
    bp_model_add_effect(banded, "actuator_deadband", whole);
    bp_model_undoable(banded, &found);
    TEST_ASSERT_EQUAL_DOUBLE(0, found.lost_voltage);
}

static void test_a_floating_motor_still_floats(void)
{
    assert_same(run(plain, NAN, 4 - 0.8), run(banded, NAN, 4));
}

static void test_a_band_of_zero_changes_nothing(void)
{
    const double none[] = {0, 0};
    bp_model_add_effect(banded, "actuator_deadband", none);
    assert_same(run(plain, 5, -3), run(banded, 5, -3));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_within_the_band_a_motor_is_shorted);
    RUN_TEST(test_beyond_the_band_the_offset_is_missing);
    RUN_TEST(test_beyond_the_band_the_whole_command_arrives_where_that_is_switched_on);
    RUN_TEST(test_only_what_is_lost_can_be_undone);
    RUN_TEST(test_a_floating_motor_still_floats);
    RUN_TEST(test_a_band_of_zero_changes_nothing);
    return UNITY_END();
}
