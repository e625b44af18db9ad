#include "affected.h"

static const double COMPRESSION = 0.5;

static void test_the_motors_get_what_the_law_leaves(void)
{
    use("voltage_compression", &COMPRESSION);
    for (double volts = -9; volts <= 9; volts += 3) {
        start(affected, NULL);
        go(volts, 0.5 * volts, STEP);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, volts / (1 + 0.5 * fabs(volts) / 9), plant.vehicle.voltage[0]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.5 * volts / (1 + 0.25 * fabs(volts) / 9), plant.vehicle.voltage[1]);
    }
}

static void test_at_full_voltage_one_plus_compression_is_lost(void)
{
    static const double SIZES[] = {-0.5, 0.25, 2};
    for (int i = 0; i < 3; i++) {
        use("voltage_compression", &SIZES[i]);
        start(affected, NULL);
        go(9, -9, STEP);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, 9 / (1 + SIZES[i]), plant.vehicle.voltage[0]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, -9 / (1 + SIZES[i]), plant.vehicle.voltage[1]);
    }
}

static void test_none_changes_nothing_and_what_floats_still_floats(void)
{
    const double none = 0;
    use("voltage_compression", &none);
    assert_no_effect();
    use("voltage_compression", &COMPRESSION);
    start(affected, NULL);
    go(NAN, 3, STEP);
    TEST_ASSERT_TRUE(isnan(plant.vehicle.voltage[0]));
}

static void test_symmetry_and_a_lone_motor(void)
{
    use("voltage_compression", &COMPRESSION);
    assert_reversal();
    assert_mirror("voltage_compression", &COMPRESSION);
    make_motor("voltage_compression", &COMPRESSION);
    assert_effect();
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_motors_get_what_the_law_leaves);
    RUN_TEST(test_at_full_voltage_one_plus_compression_is_lost);
    RUN_TEST(test_none_changes_nothing_and_what_floats_still_floats);
    RUN_TEST(test_symmetry_and_a_lone_motor);
    return UNITY_END();
}
