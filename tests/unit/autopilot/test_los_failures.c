#include "unicycle.h"

static void test_los_leg_that_takes_too_long_ends_the_route(void)
{
    config.leg_timeout_ms = 3000;
    for (int i = 0; i < 1000; i++) {
        step();
        TEST_ASSERT_EQUAL(LOS_UNDERWAY, state.status);
    }
    step();
    TEST_ASSERT_EQUAL(LOS_TIMED_OUT, state.status);
    TEST_ASSERT_EQUAL(LOS_END, state.phase);
    TEST_ASSERT_EQUAL_INT16(0, demand.speed_mm_s_q4);
}

static void test_los_ended_route_stays_ended_until_reset(void)
{
    config.leg_timeout_ms = 0;
    step();
    TEST_ASSERT_EQUAL(LOS_TIMED_OUT, state.status);
    config.leg_timeout_ms = 20000;
    step();
    TEST_ASSERT_EQUAL(LOS_TIMED_OUT, state.status);
    los_reset(&state);
    step();
    TEST_ASSERT_EQUAL(LOS_UNDERWAY, state.status);
}

static void test_los_skips_failed_legs_but_not_the_last(void)
{
    config.leg_timeout_ms = 30;
    config.skip_failed = true;
    run_ms(1000);
    TEST_ASSERT_EQUAL(LOS_TIMED_OUT, state.status);
    TEST_ASSERT_EQUAL_UINT8(7, state.waypoint);
    TEST_ASSERT_EQUAL_UINT8(7, state.skipped);
}

static void test_los_leg_after_a_skip_begins_where_the_robot_is(void)
{
    config.leg_timeout_ms = 0;
    config.skip_failed = true;
    step_at(-700.0, 300.0, 10.0);
    TEST_ASSERT_EQUAL_UINT8(1, state.waypoint);
    TEST_ASSERT_INT16_WITHIN(1, 0, state.cross_track_mm);
}

static void test_los_counts_an_overshoot_and_comes_back(void)
{
    static const route_waypoint_t AHEAD[] = {{1000, 0}};
    set_route(AHEAD, 1);
    step_at(500.0, 0.0, 0.0);
    config.bearing_hold_mm = 300;
    step_at(800.0, -120.0, 0.0);
    step_at(1149.0, -120.0, 0.0);
    TEST_ASSERT_EQUAL_UINT16(0, state.overshoots);
    step_at(1152.0, -120.0, 0.0);
    TEST_ASSERT_EQUAL_UINT16(1, state.overshoots);
    TEST_ASSERT_EQUAL(LOS_BRAKE, state.phase);
    TEST_ASSERT_EQUAL(LOS_UNDERWAY, state.status);
    step_at(1160.0, -120.0, 0.0);
    TEST_ASSERT_EQUAL_UINT16(1, state.overshoots);
    TEST_ASSERT_GREATER_THAN_INT16(16384, state.heading_error_bam16);
    run_ms(10000);
    TEST_ASSERT_EQUAL(LOS_ARRIVED, state.status);
    TEST_ASSERT_EQUAL_UINT16(1, state.overshoots);
}

static void test_los_overshoots_only_beyond_the_distance_allowed(void)
{
    static const route_waypoint_t AHEAD[] = {{1000, 0}};
    config.overshoot_mm = 150;
    set_route(AHEAD, 1);
    step_at(500.0, 0.0, 0.0);
    step_at(1150.0, -120.0, 0.0);
    TEST_ASSERT_EQUAL_UINT16(0, state.overshoots);
    step_at(1151.0, -120.0, 0.0);
    TEST_ASSERT_EQUAL_UINT16(1, state.overshoots);
}

static void test_los_counts_an_overshoot_while_coasting_in_brake(void)
{
    static const route_waypoint_t AHEAD[] = {{1000, 0}};
    set_route(AHEAD, 1);
    step_at(500.0, 0.0, 0.0);
    robot.speed_mm_s = 500.0;
    step_at(900.0, -120.0, 0.0);
    step_at(990.0, -200.0, 0.0);
    TEST_ASSERT_EQUAL(LOS_BRAKE, state.phase);
    step_at(1160.0, -200.0, 0.0);
    TEST_ASSERT_EQUAL(LOS_BRAKE, state.phase);
    TEST_ASSERT_EQUAL_UINT16(1, state.overshoots);
}

static void test_los_too_many_overshoots_end_the_route(void)
{
    static const route_waypoint_t AHEAD[] = {{3000, 0}};
    config.max_overshoots = 1;
    set_route(AHEAD, 1);
    for (uint16_t pass = 1; pass <= 2; pass++) {
        robot = (unicycle_t){0};
        while (state.phase != LOS_DRIVE)
            step();
        TEST_ASSERT_EQUAL(LOS_UNDERWAY, state.status);
        step_at(3160.0, 120.0, 0.0);
        TEST_ASSERT_EQUAL_UINT16(pass, state.overshoots);
    }
    TEST_ASSERT_EQUAL(LOS_OVERSHOT, state.status);
    TEST_ASSERT_EQUAL(LOS_END, state.phase);
}

static void test_los_too_many_overshoots_skip_the_waypoint_where_told_to(void)
{
    static const route_waypoint_t AHEAD[] = {{1000, 0}, {3000, 0}};
    config.skip_failed = true;
    config.max_overshoots = 0;
    set_route(AHEAD, 2);
    step_at(0.0, 0.0, 0.0);
    step_at(1160.0, 120.0, 0.0);
    TEST_ASSERT_EQUAL_UINT8(1, state.waypoint);
    TEST_ASSERT_EQUAL_UINT8(1, state.skipped);
    TEST_ASSERT_EQUAL(LOS_UNDERWAY, state.status);
    run_ms(10000);
    TEST_ASSERT_EQUAL(LOS_ARRIVED, state.status);
}

static void test_los_counts_no_overshoot_behind_the_last_waypoint_reached(void)
{
    static const route_waypoint_t AHEAD[] = {{1000, 0}};
    set_route(AHEAD, 1);
    config.decel_mm_s2 = 16000;
    robot.brake_mm_s2 = 300.0;
    run_ms(10000);
    TEST_ASSERT_EQUAL(LOS_ARRIVED, state.status);
    TEST_ASSERT_GREATER_THAN_INT(1150, (int)robot.x_mm);
    TEST_ASSERT_EQUAL_UINT16(0, state.overshoots);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_los_leg_that_takes_too_long_ends_the_route);
    RUN_TEST(test_los_ended_route_stays_ended_until_reset);
    RUN_TEST(test_los_skips_failed_legs_but_not_the_last);
    RUN_TEST(test_los_leg_after_a_skip_begins_where_the_robot_is);
    RUN_TEST(test_los_counts_an_overshoot_and_comes_back);
    RUN_TEST(test_los_overshoots_only_beyond_the_distance_allowed);
    RUN_TEST(test_los_counts_an_overshoot_while_coasting_in_brake);
    RUN_TEST(test_los_too_many_overshoots_end_the_route);
    RUN_TEST(test_los_too_many_overshoots_skip_the_waypoint_where_told_to);
    RUN_TEST(test_los_counts_no_overshoot_behind_the_last_waypoint_reached);
    return UNITY_END();
}
