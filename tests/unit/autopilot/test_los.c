#include "unicycle.h"

static void test_los_brakes_for_rest_ms_and_settles_for_settle_ms(void)
{
    static const route_waypoint_t BEHIND[] = {{-1000, 0}};
    set_route(BEHIND, 1);
    for (int i = 0; i < 19; i++) {
        step();
        TEST_ASSERT_EQUAL(LOS_BRAKE, state.phase);
    }
    step();
    TEST_ASSERT_EQUAL(LOS_TURN, state.phase);
    for (int i = 0; i < 30; i++)
        step();
    TEST_ASSERT_EQUAL(LOS_TURN, state.phase);
    robot.heading = TURN / 2.0;
    for (int i = 0; i < 10; i++)
        step();
    robot.yaw_rate = 0.2;
    step();
    robot.yaw_rate = 0.0;
    for (int i = 0; i < 19; i++) {
        step();
        TEST_ASSERT_EQUAL(LOS_TURN, state.phase);
    }
    step();
    TEST_ASSERT_EQUAL(LOS_DRIVE, state.phase);
}

static void test_los_steers_to_the_bearing_of_eq_22(void)
{
    for (int degree = -25; degree <= 25; degree++) {
        los_reset(&state);
        const double angle = degree * TURN / 360.0;
        const route_waypoint_t there = {(int16_t)lround(9000.0 * cos(angle)), (int16_t)lround(9000.0 * sin(angle))};
        set_route(&there, 1);
        step_at(123.0, -45.0, 0.0);
        const double bearing = atan2(there.y_mm + 45.0, there.x_mm - 123.0);
        TEST_ASSERT_INT16_WITHIN(2, 0, fix_angle_diff_bam16(bam16(bearing), demand.heading_bam16));
        TEST_ASSERT_EQUAL_INT16((int16_t)demand.heading_bam16, state.heading_error_bam16);
    }
}

static void test_los_heading_error_is_wrapped(void)
{
    static const route_waypoint_t BEHIND[] = {{-1000, -10}};
    set_route(BEHIND, 1);
    step_at(0.0, 0.0, 179.0);
    TEST_ASSERT_TRUE(state.heading_error_bam16 > 0 && state.heading_error_bam16 < 400);
    TEST_ASSERT_EQUAL(LOS_DRIVE, state.phase);
}

static void test_los_speed_follows_the_root_of_the_distance_between_creep_and_cruise(void)
{
    static const route_waypoint_t AHEAD[] = {{30000, 0}};
    set_route(AHEAD, 1);
    config.acceptance_mm = 1;
    for (int distance = 29000; distance > 1; distance -= 1 + distance / 200) {
        step_at(30000.0 - distance, 0.0, 0.0);
        const double wanted = fmin(fmax(sqrt(2.0 * 800.0 * distance), 60.0), 600.0);
        TEST_ASSERT_DOUBLE_WITHIN(0.07, wanted, demand.speed_mm_s_q4 / 16.0);
    }
}

static void test_los_creep_above_cruise_counts_as_cruise(void)
{
    static const route_waypoint_t AHEAD[] = {{30000, 0}};
    set_route(AHEAD, 1);
    config.acceptance_mm = 1;
    config.creep_mm_s_q4 = (int16_t)(config.cruise_mm_s_q4 + 1);
    step_at(29900.0, 0.0, 0.0);
    TEST_ASSERT_EQUAL_INT16(config.cruise_mm_s_q4, demand.speed_mm_s_q4);
}

static void test_los_farthest_waypoint_is_approached_at_cruise_speed(void)
{
    static const route_waypoint_t FAR[] = {{30000, 30000}};
    set_route(FAR, 1);
    config.cruise_mm_s_q4 = INT16_MAX;
    config.decel_mm_s2 = 32767;
    step_at(-2000.0, -2000.0, 45.0);
    TEST_ASSERT_EQUAL_INT16(INT16_MAX, demand.speed_mm_s_q4);
}

static void test_los_cross_track_is_positive_right_of_the_leg(void)
{
    static const route_waypoint_t EAST_THEN_NORTH[] = {{0, 5000}, {-3000, 9000}};
    set_route(EAST_THEN_NORTH, 2);
    step_at(0.0, 0.0, 90.0);
    TEST_ASSERT_EQUAL_INT16(0, state.cross_track_mm);
    step_at(-250.0, 1000.0, 90.0);
    TEST_ASSERT_EQUAL_INT16(250, state.cross_track_mm);
    step_at(250.0, 1000.0, 90.0);
    TEST_ASSERT_EQUAL_INT16(-250, state.cross_track_mm);
    step_at(0.0, 5000.0, 90.0);
    TEST_ASSERT_EQUAL_UINT8(1, state.waypoint);
    step_at(-1500.0 - 80.0, 7000.0 - 60.0, 90.0);
    TEST_ASSERT_INT16_WITHIN(1, 100, state.cross_track_mm);
}

static void test_los_bearing_does_not_swing_near_the_waypoint(void)
{
    static const route_waypoint_t AHEAD[] = {{1000, 0}};
    set_route(AHEAD, 1);
    step_at(0.0, 0.0, 0.0);
    step_at(855.0, 40.0, 0.0);
    const uint16_t outside = demand.heading_bam16;
    step_at(890.0, 60.0, 0.0);
    TEST_ASSERT_UINT16_WITHIN(1, 0, outside);
    TEST_ASSERT_EQUAL_UINT16(outside, demand.heading_bam16);
    config.bearing_hold_mm = 0;
    step_at(890.0, 60.0, 0.0);
    TEST_ASSERT_NOT_EQUAL(outside, demand.heading_bam16);
}

static void test_los_holds_the_bearing_up_to_its_distance_and_not_beyond(void)
{
    static const route_waypoint_t AHEAD[] = {{1000, 0}};
    set_route(AHEAD, 1);
    config.bearing_hold_mm = 129;
    step_at(0.0, 0.0, 0.0);
    step_at(881.0, 50.0, 0.0); /* 129.1 mm, before the hold's end at 130 */
    TEST_ASSERT_EQUAL_UINT16(0, demand.heading_bam16);
    step_at(880.0, 50.0, 0.0);
    TEST_ASSERT_EQUAL_UINT16(bam16(atan2(-50.0, 120.0)), demand.heading_bam16);
}

static void test_los_accepts_at_the_radius_and_not_beyond(void)
{
    step_at(1000.0 - 60.0, 1000.0 - 81.0, 45.0);
    TEST_ASSERT_EQUAL_UINT8(0, state.waypoint);
    step_at(1000.0 - 60.0, 1000.0 - 80.0, 45.0);
    TEST_ASSERT_EQUAL_UINT8(1, state.waypoint);
    TEST_ASSERT_EQUAL_UINT32(0, state.leg_ms);
}

static void test_los_turns_off_a_large_heading_error_at_rest(void)
{
    step_at(0.0, 0.0, 45.0);
    TEST_ASSERT_EQUAL(LOS_DRIVE, state.phase);
    step_at(10.0, 10.0, 80.0);
    TEST_ASSERT_EQUAL(LOS_BRAKE, state.phase);
    TEST_ASSERT_EQUAL_UINT16(bam16(80.0 * TURN / 360.0), demand.heading_bam16);
}

static void test_los_takes_the_ends_of_every_range(void)
{
    static const int32_t PLACES_UM[] = {INT32_MIN, -2000000000, -30000000, 0, 30000000, 2000000000, INT32_MAX};
    static const route_waypoint_t CORNERS[] = {{30000, 30000}, {-30000, -30000}};
    config.cruise_mm_s_q4 = INT16_MAX;
    config.decel_mm_s2 = 32767;
    config.leg_timeout_ms = INT32_MAX;
    set_route(CORNERS, 2);
    for (int i = 0; i < 7; i++)
        for (int j = 0; j < 7; j++) {
            const signals_estimate_t far = {.x_um = PLACES_UM[i],
                                            .y_um = PLACES_UM[j],
                                            .speed_mm_s_q4 = INT16_MIN,
                                            .yaw_rate_mrad_s = INT16_MIN,
                                            .heading_bam16 = 32768,
                                            .valid = true,
                                            .period_ms = 255};
            los_reset(&state);
            los_step(&config, &route, &state, &far, &demand);
            TEST_ASSERT_GREATER_OR_EQUAL_INT16(0, demand.speed_mm_s_q4);
        }
}

static void test_los_begins_each_wait_from_nothing(void)
{
    static const route_waypoint_t BEHIND[] = {{-1000, 0}};
    config.rest_ms = config.settle_ms = 58; /* 20 steps of 3 ms, and 19 of them with 1 ms more */
    set_route(BEHIND, 1);
    for (int i = 0; i < 10; i++)
        step();
    robot.speed_mm_s = 20.0;
    step();
    robot.speed_mm_s = 0.0;
    for (int i = 0; i < 19; i++) {
        step();
        TEST_ASSERT_EQUAL(LOS_BRAKE, state.phase);
    }
    robot.heading = TURN / 2.0;
    robot.yaw_rate = 0.1; /* still at rest */
    step();
    for (int i = 0; i < 19; i++) {
        TEST_ASSERT_EQUAL(LOS_TURN, state.phase);
        step();
    }
    robot.yaw_rate = 0.101;
    step();
    robot.yaw_rate = 0.1;
    for (int i = 0; i < 19; i++) {
        step();
        TEST_ASSERT_EQUAL(LOS_TURN, state.phase);
    }
    step();
    TEST_ASSERT_EQUAL(LOS_DRIVE, state.phase);
}

static void test_los_pivots_beyond_the_angle_and_not_at_it(void)
{
    static const route_waypoint_t AHEAD[] = {{1000, 0}};
    set_route(AHEAD, 1);
    for (int beyond = 0; beyond < 2; beyond++) {
        signals_estimate_t estimate = estimated();
        estimate.heading_bam16 = (uint16_t)(config.pivot_bam16 + beyond);
        los_reset(&state);
        los_step(&config, &route, &state, &estimate, &demand);
        TEST_ASSERT_EQUAL(beyond ? LOS_BRAKE : LOS_DRIVE, state.phase);
    }
}

static void test_los_leg_runs_from_one_waypoint_to_the_next(void)
{
    static const route_waypoint_t CORNER[] = {{500, 300}, {500, 1300}};
    set_route(CORNER, 2);
    step_at(450.0, 300.0, 90.0);
    TEST_ASSERT_EQUAL_UINT8(1, state.waypoint);
    step_at(480.0, 600.0, 90.0);
    TEST_ASSERT_INT16_WITHIN(1, 20, (int16_t)fix_abs_u16(state.cross_track_mm));
    step_at(500.0, 700.0, 90.0);
    TEST_ASSERT_INT16_WITHIN(1, 0, state.cross_track_mm);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_los_brakes_for_rest_ms_and_settles_for_settle_ms);
    RUN_TEST(test_los_creep_above_cruise_counts_as_cruise);
    RUN_TEST(test_los_farthest_waypoint_is_approached_at_cruise_speed);
    RUN_TEST(test_los_steers_to_the_bearing_of_eq_22);
    RUN_TEST(test_los_heading_error_is_wrapped);
    RUN_TEST(test_los_speed_follows_the_root_of_the_distance_between_creep_and_cruise);
    RUN_TEST(test_los_cross_track_is_positive_right_of_the_leg);
    RUN_TEST(test_los_bearing_does_not_swing_near_the_waypoint);
    RUN_TEST(test_los_holds_the_bearing_up_to_its_distance_and_not_beyond);
    RUN_TEST(test_los_accepts_at_the_radius_and_not_beyond);
    RUN_TEST(test_los_turns_off_a_large_heading_error_at_rest);
    RUN_TEST(test_los_takes_the_ends_of_every_range);
    RUN_TEST(test_los_begins_each_wait_from_nothing);
    RUN_TEST(test_los_pivots_beyond_the_angle_and_not_at_it);
    RUN_TEST(test_los_leg_runs_from_one_waypoint_to_the_next);
    return UNITY_END();
}
