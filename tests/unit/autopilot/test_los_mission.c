#include "unicycle.h"

static void test_los_reaches_the_eight_waypoints_of_the_paper_in_order_in_60_s(void)
{
    uint8_t reached = 0;
    for (uint32_t time = 0; time < 60000 && state.status == LOS_UNDERWAY; time += PERIOD_MS) {
        const uint8_t before = state.waypoint;
        step();
        if (state.waypoint != before || (state.last_reached && reached == 7)) {
            TEST_ASSERT_EQUAL_UINT8(reached, before);
            const double distance = hypot(PAPER[before].x_mm - robot.x_mm, PAPER[before].y_mm - robot.y_mm);
            TEST_ASSERT_DOUBLE_WITHIN(3.0, 98.5, distance);
            reached++;
        }
        drive(PERIOD_MS / 1000.0);
    }
    TEST_ASSERT_EQUAL_UINT8(8, reached);
    TEST_ASSERT_EQUAL(LOS_ARRIVED, state.status);
    TEST_ASSERT_EQUAL(LOS_END, state.phase);
    TEST_ASSERT_EQUAL_UINT16(0, state.overshoots);
}

static void test_los_mirrored_mission_is_the_mirror_image(void)
{
    route_waypoint_t mirrored[8];
    double y_mm[5000];
    for (int i = 0; i < 8; i++)
        mirrored[i] = (route_waypoint_t){PAPER[i].x_mm, (int16_t)-PAPER[i].y_mm};
    for (int i = 0; i < 5000; i++) {
        run_ms(PERIOD_MS);
        y_mm[i] = robot.y_mm;
    }
    robot = (unicycle_t){.brake_mm_s2 = 1500.0};
    los_reset(&state);
    route_set(&route, mirrored, 8);
    for (int i = 0; i < 5000; i++) {
        run_ms(PERIOD_MS);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, -y_mm[i], robot.y_mm);
    }
}

static void test_los_stops_before_it_turns_and_turns_before_it_drives(void)
{
    static const route_waypoint_t CORNER[] = {{1000, 0}, {1000, 1000}};
    set_route(CORNER, 2);
    los_phase_t last = LOS_BEGIN;
    int phases[5] = {0};
    for (int i = 0; i < 5000 && state.status == LOS_UNDERWAY; i++) {
        run_ms(PERIOD_MS);
        if (state.phase != last)
            phases[state.phase]++;
        if (state.phase == LOS_BRAKE) {
            TEST_ASSERT_EQUAL_UINT16(state.hold_heading_bam16, demand.heading_bam16);
            TEST_ASSERT_EQUAL_INT16(0, demand.speed_mm_s_q4);
        }
        if (state.phase == LOS_TURN) {
            TEST_ASSERT_TRUE(last == LOS_BRAKE || last == LOS_TURN);
            TEST_ASSERT_TRUE(fabs(robot.speed_mm_s) <= 10.0);
            TEST_ASSERT_EQUAL_INT16(0, demand.speed_mm_s_q4);
        }
        if (state.phase == LOS_DRIVE && last == LOS_TURN)
            TEST_ASSERT_INT16_WITHIN(364, 0, state.heading_error_bam16);
        last = state.phase;
    }
    TEST_ASSERT_EQUAL(LOS_ARRIVED, state.status);
    TEST_ASSERT_EQUAL_INT(2, phases[LOS_BRAKE]); /* at the corner and at the end */
    TEST_ASSERT_TRUE(fabs(robot.speed_mm_s) <= 10.0);
    TEST_ASSERT_EQUAL_INT(1, phases[LOS_TURN]);
    TEST_ASSERT_EQUAL_INT(2, phases[LOS_DRIVE]);
}

static void test_los_does_not_stop_for_a_bend_below_the_pivot_angle(void)
{
    static const route_waypoint_t BEND[] = {{1000, 0}, {2000, 300}};
    set_route(BEND, 2);
    while (state.status == LOS_UNDERWAY && robot.x_mm < 3000.0) {
        run_ms(PERIOD_MS);
        TEST_ASSERT_TRUE(state.last_reached || state.phase == LOS_DRIVE || state.phase == LOS_END);
    }
    TEST_ASSERT_EQUAL(LOS_ARRIVED, state.status);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_los_reaches_the_eight_waypoints_of_the_paper_in_order_in_60_s);
    RUN_TEST(test_los_mirrored_mission_is_the_mirror_image);
    RUN_TEST(test_los_stops_before_it_turns_and_turns_before_it_drives);
    RUN_TEST(test_los_does_not_stop_for_a_bend_below_the_pivot_angle);
    return UNITY_END();
}
