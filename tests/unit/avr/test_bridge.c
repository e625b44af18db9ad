/* The H-bridge round the AVR: its truth table, and the duty that it gives a motor. */
#include <math.h>

#include "avr/bridge.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

static void test_the_truth_table_is_that_of_the_board(void)
{
    TEST_ASSERT_EQUAL(BRIDGE_FORWARD, bridge_state(true, false, true));
    TEST_ASSERT_EQUAL(BRIDGE_BACKWARD, bridge_state(false, true, true));
    TEST_ASSERT_EQUAL(BRIDGE_SHORT, bridge_state(true, false, false));
    TEST_ASSERT_EQUAL(BRIDGE_SHORT, bridge_state(false, true, false));
    TEST_ASSERT_EQUAL(BRIDGE_SHORT, bridge_state(true, true, true));
    TEST_ASSERT_EQUAL(BRIDGE_COAST, bridge_state(false, false, false));
    TEST_ASSERT_EQUAL(BRIDGE_COAST, bridge_state(false, false, true));
}

static void test_pulses_count_to_the_cycle(void)
{
    bridge_t bridge = {.state = BRIDGE_SHORT};

    bridge_set(&bridge, BRIDGE_FORWARD, 1000);
    bridge_set(&bridge, BRIDGE_SHORT, 1300);
    bridge_count(&bridge, 2000);
    TEST_ASSERT_EQUAL(300, bridge.cycles[BRIDGE_FORWARD]);
    TEST_ASSERT_EQUAL(1700, bridge.cycles[BRIDGE_SHORT]);
    TEST_ASSERT_TRUE(bridge_duty(&bridge) == 300.0 / 2000);
    bridge_clear(&bridge);
    bridge_set(&bridge, BRIDGE_BACKWARD, 2000);
    bridge_count(&bridge, 2500);
    TEST_ASSERT_TRUE(bridge_duty(&bridge) == -1.0);
}

static void test_an_event_before_the_last_one_counts_as_that_one(void)
{
    bridge_t bridge = {.state = BRIDGE_SHORT};

    bridge_count(&bridge, 1000);
    bridge_set(&bridge, BRIDGE_FORWARD, 998);
    bridge_count(&bridge, 2000);
    TEST_ASSERT_EQUAL(1000, bridge.cycles[BRIDGE_SHORT]);
    TEST_ASSERT_EQUAL(1000, bridge.cycles[BRIDGE_FORWARD]);
}

static void test_a_motor_that_coasts_for_most_of_the_time_has_no_duty(void)
{
    bridge_t bridge = {.state = BRIDGE_COAST};

    TEST_ASSERT_TRUE(isnan(bridge_duty(&bridge)));
    bridge_set(&bridge, BRIDGE_FORWARD, 600);
    bridge_count(&bridge, 1000);
    TEST_ASSERT_TRUE(isnan(bridge_duty(&bridge)));
    bridge_count(&bridge, 1300);
    TEST_ASSERT_TRUE(bridge_duty(&bridge) == 1.0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_truth_table_is_that_of_the_board);
    RUN_TEST(test_pulses_count_to_the_cycle);
    RUN_TEST(test_an_event_before_the_last_one_counts_as_that_one);
    RUN_TEST(test_a_motor_that_coasts_for_most_of_the_time_has_no_duty);
    return UNITY_END();
}
