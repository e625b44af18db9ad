#include "autopilot/mode.h"
#include "unity.h"

enum { PERIOD_MS = 3 };

static const route_waypoint_t WAYPOINTS[] = {{1000, 0}, {2000, 0}};
static mode_config_t config;
static route_t route;
static mode_state_t state;
static signals_estimate_t estimate;
static signals_demand_t demand;

void setUp(void)
{
    config = (mode_config_t){.los = {.acceptance_mm = 100,
                                     .cruise_mm_s_q4 = 4000,
                                     .decel_mm_s2 = 500,
                                     .pivot_bam16 = 5461,
                                     .align_bam16 = 364,
                                     .overshoot_mm = 150,
                                     .leg_timeout_ms = 10000},
                             .lost_ms = 30};
    state = (mode_state_t){0};
    estimate = (signals_estimate_t){.period_ms = PERIOD_MS, .valid = true};
    demand = (signals_demand_t){0};
    TEST_ASSERT_EQUAL(ROUTE_OK, route_set(&route, WAYPOINTS, 2));
}
void tearDown(void) {}

static void step(mode_command_t command)
{
    mode_step(&config, &route, &state, &estimate, command, &demand);
}

static void step_at_mm(int32_t x_mm, int32_t y_mm)
{
    estimate.x_um = x_mm * 1000;
    estimate.y_um = y_mm * 1000;
    step(MODE_NONE);
}

static void assert_stopped(mode_name_t mode, mode_fault_t fault)
{
    TEST_ASSERT_EQUAL(mode, state.mode);
    TEST_ASSERT_EQUAL(fault, state.fault);
    TEST_ASSERT_FALSE(demand.drive);
    TEST_ASSERT_EQUAL_INT16(0, demand.speed_mm_s_q4);
}

static void test_mode_idles_with_motors_off_until_started(void)
{
    for (int i = 0; i < 100; i++)
        step(MODE_NONE);
    assert_stopped(MODE_IDLE, MODE_NO_FAULT);
    step(MODE_ABORT);
    step(MODE_RESET);
    assert_stopped(MODE_IDLE, MODE_NO_FAULT);
}

static void test_mode_start_drives_in_the_same_step(void)
{
    step(MODE_START);
    TEST_ASSERT_EQUAL(MODE_RUN, state.mode);
    TEST_ASSERT_TRUE(demand.drive);
    TEST_ASSERT_EQUAL_INT16(4000, demand.speed_mm_s_q4);
    TEST_ASSERT_EQUAL_UINT16(0, demand.heading_bam16);
}

static void test_mode_passes_the_heading_on(void)
{
    estimate.heading_bam16 = 1000;
    estimate.y_um = -100000;
    step(MODE_START);
    TEST_ASSERT_UINT16_WITHIN(2, 1040, demand.heading_bam16);
}

static void test_mode_waits_at_rest_for_the_gyros_bias(void)
{
    estimate.bias_unknown = true;
    step(MODE_START);
    for (int i = 0; i < 100; i++) {
        step(MODE_NONE);
        TEST_ASSERT_EQUAL(MODE_RUN, state.mode);
        TEST_ASSERT_FALSE(demand.drive);
        TEST_ASSERT_EQUAL(LOS_BEGIN, state.los.phase);
    }
    estimate.bias_unknown = false;
    step(MODE_NONE);
    TEST_ASSERT_TRUE(demand.drive);
    estimate.bias_unknown = true; /* a reference is missing: a run that drives goes on and is still guided */
    step(MODE_NONE);
    TEST_ASSERT_TRUE(demand.drive);
    step_at_mm(0, 80);
    TEST_ASSERT_EQUAL_INT16(80, state.los.cross_track_mm);
}

static void test_mode_drives_without_a_bias_after_255_steps_of_each_run(void)
{
    estimate.bias_unknown = true;
    for (int run = 0; run < 2; run++) {
        step(MODE_START);
        for (int i = 1; i < 255; i++)
            step(MODE_NONE);
        TEST_ASSERT_FALSE(demand.drive);
        step(MODE_NONE);
        TEST_ASSERT_TRUE(demand.drive);
        for (int i = 0; i < 600; i++)
            step(MODE_NONE);
        TEST_ASSERT_TRUE(demand.drive);
        step(MODE_ABORT);
        step(MODE_RESET);
    }
}

static void test_mode_waits_afresh_after_a_run_that_was_aborted_at_rest(void)
{
    estimate.bias_unknown = true;
    step(MODE_START);
    for (int i = 0; i < 200; i++)
        step(MODE_NONE);
    step(MODE_ABORT);
    step(MODE_RESET);
    step(MODE_START);
    for (int i = 0; i < 200; i++)
        step(MODE_NONE);
    TEST_ASSERT_FALSE(demand.drive);
}

static void test_mode_does_not_wait_for_a_bias_without_a_state(void)
{
    estimate.bias_unknown = true;
    step(MODE_START);
    estimate.valid = false;
    for (int i = 0; i < 11; i++)
        step(MODE_NONE);
    assert_stopped(MODE_FAULT, MODE_STATE_LOST);
}

static void test_mode_arrives_at_the_last_waypoint_and_stays(void)
{
    step(MODE_START);
    step_at_mm(950, 0);
    TEST_ASSERT_EQUAL(MODE_RUN, state.mode);
    step_at_mm(1950, 0);
    for (uint32_t rest_ms = PERIOD_MS; rest_ms < config.los.rest_ms; rest_ms += PERIOD_MS) {
        TEST_ASSERT_EQUAL(MODE_RUN, state.mode);
        step(MODE_NONE);
    }
    step(MODE_NONE);
    assert_stopped(MODE_ARRIVED, MODE_NO_FAULT);
    step(MODE_START);
    step(MODE_ABORT);
    assert_stopped(MODE_ARRIVED, MODE_NO_FAULT);
    step(MODE_RESET);
    assert_stopped(MODE_IDLE, MODE_NO_FAULT);
}

static void test_mode_leg_time_out_is_a_fault(void)
{
    config.los.leg_timeout_ms = 30;
    step(MODE_START);
    for (int i = 0; i < 9; i++) {
        step(MODE_NONE);
        TEST_ASSERT_EQUAL(MODE_RUN, state.mode);
    }
    step(MODE_NONE);
    assert_stopped(MODE_FAULT, MODE_LEG_TIMED_OUT);
}

static void test_mode_overshoot_is_a_fault(void)
{
    step(MODE_START);
    step_at_mm(1160, 120);
    assert_stopped(MODE_FAULT, MODE_LEG_OVERSHOT);
}

static void test_mode_abort_is_a_fault(void)
{
    step(MODE_START);
    step(MODE_ABORT);
    assert_stopped(MODE_FAULT, MODE_COMMANDED);
}

static void test_mode_a_cut_is_a_fault_of_its_own(void)
{
    step(MODE_CUT_LATE); /* in IDLE: nothing to cut */
    assert_stopped(MODE_IDLE, MODE_NO_FAULT);
    step(MODE_START);
    step(MODE_CUT_LATE);
    assert_stopped(MODE_FAULT, MODE_LATE);
    step(MODE_RESET);
    step(MODE_START);
    step(MODE_CUT_SILENT);
    assert_stopped(MODE_FAULT, MODE_SILENT);
}

static void test_mode_empty_route_is_a_fault(void)
{
    route = (route_t){0};
    step(MODE_START);
    assert_stopped(MODE_FAULT, MODE_NO_ROUTE);
}

static void test_mode_keeps_the_last_demand_while_the_state_is_briefly_lost(void)
{
    step(MODE_START);
    estimate.valid = false;
    for (int i = 0; i < 10; i++) {
        step(MODE_NONE);
        TEST_ASSERT_EQUAL(MODE_RUN, state.mode);
        TEST_ASSERT_EQUAL_INT16(4000, demand.speed_mm_s_q4);
    }
    step(MODE_NONE);
    assert_stopped(MODE_FAULT, MODE_STATE_LOST);
}

static void test_mode_lost_time_begins_anew_with_each_valid_state(void)
{
    step(MODE_START);
    for (int i = 0; i < 100; i++) {
        estimate.valid = i % 10 == 0;
        step(MODE_NONE);
    }
    TEST_ASSERT_EQUAL(MODE_RUN, state.mode);
}

static void test_mode_without_a_state_starts_with_motors_off_and_gives_up(void)
{
    estimate.valid = false;
    step(MODE_START);
    TEST_ASSERT_EQUAL(MODE_RUN, state.mode);
    TEST_ASSERT_FALSE(demand.drive);
    for (int i = 0; i < 10; i++)
        step(MODE_NONE);
    assert_stopped(MODE_FAULT, MODE_STATE_LOST);
}

static void test_mode_lost_time_begins_anew_with_each_start(void)
{
    step(MODE_START);
    estimate.valid = false;
    for (int i = 0; i < 9; i++)
        step(MODE_NONE);
    step(MODE_ABORT);
    step(MODE_RESET);
    step(MODE_START);
    for (int i = 0; i < 9; i++)
        step(MODE_NONE);
    TEST_ASSERT_EQUAL(MODE_RUN, state.mode);
}

static void test_mode_only_a_reset_leaves_fault(void)
{
    step(MODE_START);
    step(MODE_ABORT);
    step(MODE_START);
    step_at_mm(1950, 0);
    step(MODE_ABORT);
    assert_stopped(MODE_FAULT, MODE_COMMANDED);
    step(MODE_RESET);
    assert_stopped(MODE_IDLE, MODE_NO_FAULT);
    step(MODE_START);
    TEST_ASSERT_EQUAL(MODE_RUN, state.mode);
    TEST_ASSERT_EQUAL_UINT8(0, state.los.waypoint);
}

static void test_mode_reset_does_not_stop_a_run(void)
{
    step(MODE_START);
    step(MODE_RESET);
    TEST_ASSERT_EQUAL(MODE_RUN, state.mode);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_mode_idles_with_motors_off_until_started);
    RUN_TEST(test_mode_start_drives_in_the_same_step);
    RUN_TEST(test_mode_passes_the_heading_on);
    RUN_TEST(test_mode_waits_at_rest_for_the_gyros_bias);
    RUN_TEST(test_mode_drives_without_a_bias_after_255_steps_of_each_run);
    RUN_TEST(test_mode_waits_afresh_after_a_run_that_was_aborted_at_rest);
    RUN_TEST(test_mode_does_not_wait_for_a_bias_without_a_state);
    RUN_TEST(test_mode_arrives_at_the_last_waypoint_and_stays);
    RUN_TEST(test_mode_leg_time_out_is_a_fault);
    RUN_TEST(test_mode_overshoot_is_a_fault);
    RUN_TEST(test_mode_abort_is_a_fault);
    RUN_TEST(test_mode_a_cut_is_a_fault_of_its_own);
    RUN_TEST(test_mode_empty_route_is_a_fault);
    RUN_TEST(test_mode_keeps_the_last_demand_while_the_state_is_briefly_lost);
    RUN_TEST(test_mode_lost_time_begins_anew_with_each_valid_state);
    RUN_TEST(test_mode_without_a_state_starts_with_motors_off_and_gives_up);
    RUN_TEST(test_mode_lost_time_begins_anew_with_each_start);
    RUN_TEST(test_mode_only_a_reset_leaves_fault);
    RUN_TEST(test_mode_reset_does_not_stop_a_run);
    return UNITY_END();
}
