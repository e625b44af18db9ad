#include "affected.h"

static const double LIMIT = 4;

static bp_state run(const bp_model *model, double left, double right)
{
    start(model, NULL);
    go(left, right, 0.3);
    return plant.vehicle.state;
}

static void test_beyond_the_limit_there_is_the_limit(void)
{
    use("supply_saturation", &LIMIT);
    assert_same(run(plain, 4, -4), run(affected, 9, -4.5));
}

static void test_within_it_nothing_changes_and_floating_stays(void)
{
    use("supply_saturation", &LIMIT);
    assert_same(run(plain, 3.9, -4), run(affected, 3.9, -4));
    assert_same(run(plain, NAN, 4), run(affected, NAN, 7));
}

static void test_a_limit_out_of_reach_changes_nothing(void)
{
    const double high = 1000;
    use("supply_saturation", &high);
    assert_no_effect();
}

static void test_symmetry_and_a_lone_motor(void)
{
    use("supply_saturation", &LIMIT);
    assert_reversal();
    assert_mirror("supply_saturation", &LIMIT);
    make_motor("supply_saturation", &LIMIT);
    assert_effect();
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_beyond_the_limit_there_is_the_limit);
    RUN_TEST(test_within_it_nothing_changes_and_floating_stays);
    RUN_TEST(test_a_limit_out_of_reach_changes_nothing);
    RUN_TEST(test_symmetry_and_a_lone_motor);
    return UNITY_END();
}
