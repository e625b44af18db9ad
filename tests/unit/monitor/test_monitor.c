#include "app/params_gen.h"
#include "monitor/monitor.h"
#include "unity.h"

enum { PERIOD_MS = 3, BATTERY_MV = 9000, RAMP_STEPS = 100 };

/* What is wrong with the robot. Shares in 1/1000. */
typedef struct {
    int friction_mv[2];
    int braking[2];
    int supply[2];
    int slip[2];
    int sag; /* resistance of the battery by that of a motor */
} fault_t;

static const monitor_config_t *const CONFIG = &MONITOR_COUPLED;
static const fault_t SOUND;
static monitor_state_t state;
static signals_estimate_t estimate;
static signals_drive_t drives;
static uint16_t battery_mv;

void setUp(void)
{
    state = (monitor_state_t){.clock_ms = 0};
    estimate = (signals_estimate_t){.period_ms = PERIOD_MS, .valid = true};
    drives = (signals_drive_t){.left_mv = 0};
    battery_mv = BATTERY_MV;
}

void tearDown(void) {}

static int16_t rounded(double value)
{
    return (int16_t)(value < 0 ? value - 0.5 : value + 0.5);
}

/* A step in which the robot has reached this speed and yaw rate: the voltages are those that the motors need. */
static void step(const fault_t *fault, double speed_mm_s, double yaw_rate_mrad_s)
{
    const double travel_mm_s = (speed_mm_s + estimate.speed_mm_s_q4 / 16.0) / 2;
    const double surge = CONFIG->surge_q10 / 16.0 * (speed_mm_s * 16 - estimate.speed_mm_s_q4) / PERIOD_MS;
    const double yaw = CONFIG->yaw_q10 / 16.0 * (yaw_rate_mrad_s - estimate.yaw_rate_mrad_s) / PERIOD_MS;
    double voltage[2], load = 0;

    for (int side = 0; side < 2; side++) {
        const int sign = side == 0 ? 1 : -1;
        const double turning_mm_s = sign * yaw_rate_mrad_s * CONFIG->half_track_m_q14 / 16384;
        const double emf = (travel_mm_s + turning_mm_s) * CONFIG->mv_per_mm_s_q10 / 1024;
        double needs = emf * (1 + fault->braking[side] / 1e3) + surge + sign * yaw * (1 + fault->slip[side] / 1e3);
        needs += emf > 0 ? fault->friction_mv[side] : emf < 0 ? -fault->friction_mv[side] : 0;
        voltage[side] = needs / (1 - fault->supply[side] / 1e3);
        load += voltage[side] / BATTERY_MV * (voltage[side] - emf);
    }
    estimate.travel_um_q5 = (int32_t)(travel_mm_s * PERIOD_MS * 32);
    estimate.speed_mm_s_q4 = rounded(speed_mm_s * 16);
    estimate.yaw_rate_mrad_s = rounded(yaw_rate_mrad_s);
    drives.left_mv = rounded(voltage[0]);
    drives.right_mv = rounded(voltage[1]);
    battery_mv = (uint16_t)rounded(BATTERY_MV - load * fault->sag / 1e3);
    monitor_step(CONFIG, &state, &estimate, &drives, battery_mv);
}

/* Changes speed and yaw rate evenly, and then holds them for `held` steps. */
static void reach(const fault_t *fault, double speed_mm_s, double yaw_rate_mrad_s, int held)
{
    const double speed = estimate.speed_mm_s_q4 / 16.0, yaw = estimate.yaw_rate_mrad_s;
    for (int i = 1; i <= RAMP_STEPS; i++)
        step(fault, speed + (speed_mm_s - speed) * i / RAMP_STEPS, yaw + (yaw_rate_mrad_s - yaw) * i / RAMP_STEPS);
    for (int i = 0; i < held; i++)
        step(fault, speed_mm_s, yaw_rate_mrad_s);
}

/* Straight legs forward and backward at several speeds, with turns on the spot between: about 8 s. */
static void drive(const fault_t *fault)
{
    for (int i = 0; i < 2; i++) {
        reach(fault, 400, 0, 300);
        reach(fault, 0, 0, 20);
        reach(fault, 0, 5000, 100);
        reach(fault, 0, -5000, 100);
        reach(fault, 0, 0, 20);
        reach(fault, 150, 0, 300);
        reach(fault, -300, 0, 100);
        reach(fault, 0, 0, 20);
    }
}

static void says(uint8_t channel, monitor_cause_t cause, int size, int within)
{
    TEST_ASSERT_EQUAL_UINT8(cause, state.report[channel].cause);
    TEST_ASSERT_INT_WITHIN((unsigned)within, size, state.report[channel].size);
}

static void test_monitor_says_nothing_of_a_robot_like_the_model(void)
{
    for (int i = 0; i < 4; i++)
        drive(&SOUND);
    for (uint8_t channel = 0; channel < MONITOR_CHANNELS; channel++)
        says(channel, MONITOR_NONE, 0, 0);
    TEST_ASSERT_UINT32_WITHIN(20000, state.clock_ms, state.report[MONITOR_LEFT].since_ms);
}

static void test_monitor_names_each_cause_of_each_wheel_with_size_and_onset(void)
{
    static const struct {
        fault_t fault;
        monitor_cause_t cause;
        int size;
    } CASES[] = {
        {{.friction_mv = {500, 0}}, MONITOR_FRICTION, 500},
        {{.friction_mv = {0, 500}}, MONITOR_FRICTION, 500},
        {{.braking = {300, 0}}, MONITOR_BRAKING, 300},
        {{.braking = {0, -200}}, MONITOR_BRAKING, -200},
        {{.supply = {200, 0}}, MONITOR_SUPPLY, 200},
        {{.supply = {0, 300}}, MONITOR_SUPPLY, 300},
        {{.slip = {400, 0}}, MONITOR_SLIP, 400},
        {{.slip = {0, -250}}, MONITOR_SLIP, -250},
    };
    for (unsigned i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        const uint8_t wrong = i % 2 == 0 ? MONITOR_LEFT : MONITOR_RIGHT;
        setUp();
        drive(&SOUND);
        const uint32_t onset_ms = state.clock_ms;
        drive(&CASES[i].fault);
        drive(&CASES[i].fault);
        says(wrong, CASES[i].cause, CASES[i].size, CASES[i].cause == MONITOR_FRICTION ? 30 : 20);
        says((uint8_t)(1 - wrong), MONITOR_NONE, 0, 0);
        says(MONITOR_BATTERY, MONITOR_NONE, 0, 0);
        TEST_ASSERT_UINT32_WITHIN(2500, onset_ms, state.report[wrong].since_ms);
    }
}

static void test_monitor_names_the_battery_whose_voltage_sags(void)
{
    const fault_t fault = {.sag = 300};
    drive(&SOUND);
    drive(&fault);
    says(MONITOR_BATTERY, MONITOR_SUPPLY, 300, 60); /* the hardest turns pass the limit of 32 standard deviations */
    says(MONITOR_LEFT, MONITOR_NONE, 0, 0);
    says(MONITOR_RIGHT, MONITOR_NONE, 0, 0);
}

static void test_monitor_takes_the_battery_before_the_first_drive_as_reference(void)
{
    battery_mv = 7600;
    monitor_step(CONFIG, &state, &estimate, &drives, battery_mv);
    TEST_ASSERT_EQUAL_UINT16(7600, state.reference_mv);
    battery_mv = 7700;
    drives.right_mv = 100;
    monitor_step(CONFIG, &state, &estimate, &drives, battery_mv);
    battery_mv = 7000;
    monitor_step(CONFIG, &state, &estimate, &drives, battery_mv);
    TEST_ASSERT_EQUAL_UINT16(7700, state.reference_mv);
    setUp();
    drives.left_mv = 100;
    monitor_step(CONFIG, &state, &estimate, &drives, battery_mv);
    battery_mv = 7000;
    monitor_step(CONFIG, &state, &estimate, &drives, battery_mv);
    TEST_ASSERT_EQUAL_UINT16(BATTERY_MV, state.reference_mv);
}

static void test_monitor_withdraws_a_cause_that_is_gone(void)
{
    const fault_t fault = {.friction_mv = {500, 500}};
    drive(&fault);
    says(MONITOR_LEFT, MONITOR_FRICTION, 500, 30);
    reach(&SOUND, 400, 0, 1000);
    TEST_ASSERT_EQUAL_UINT8(MONITOR_FRICTION,
                            state.report[MONITOR_LEFT].cause); /* the evidence has to be gone for some time */
    drive(&SOUND);
    says(MONITOR_LEFT, MONITOR_NONE, 0, 0);
    says(MONITOR_RIGHT, MONITOR_NONE, 0, 0);
}

static void test_monitor_is_undecided_where_the_drive_tells_nothing_apart(void)
{
    const fault_t fault = {.braking = {300, 0}};
    reach(&fault, 300, 0, 2000);
    says(MONITOR_LEFT, MONITOR_UNDECIDED, 0, 0);
    for (int i = 0; i < 4; i++)
        drive(&fault);
    says(MONITOR_LEFT, MONITOR_BRAKING, 300, 30);
    reach(&fault, 300, 0, 300); /* and keeps the name */
    says(MONITOR_LEFT, MONITOR_BRAKING, 300, 30);
}

static void test_monitor_gives_a_cause_another_name_when_the_evidence_does(void)
{
    const fault_t first = {.supply = {300, 0}}, second = {.friction_mv = {1500, 0}};
    for (int i = 0; i < 2; i++)
        drive(&first);
    says(MONITOR_LEFT, MONITOR_SUPPLY, 300, 30);
    for (int i = 0; i < 12; i++)
        drive(&second);
    says(MONITOR_LEFT, MONITOR_FRICTION, 1500, 300);
}

static void test_monitor_takes_no_block_with_a_bad_estimate(void)
{
    const fault_t fault = {.friction_mv = {800, 800}, .sag = 500};
    estimate.valid = false;
    drive(&fault);
    for (uint8_t channel = 0; channel < MONITOR_CHANNELS; channel++)
        says(channel, MONITOR_NONE, 0, 0);
}

static void test_monitor_takes_no_wheel_that_hardly_moves(void)
{
    const fault_t fault = {.friction_mv = {800, 800}};
    reach(&fault, 60, 0, 3000);
    says(MONITOR_LEFT, MONITOR_NONE, 0, 0);
    says(MONITOR_RIGHT, MONITOR_NONE, 0, 0);
}

static void test_monitor_needs_more_than_one_wild_block(void)
{
    drive(&SOUND);
    reach(&SOUND, 400, 0, 100);
    for (int i = 0; i < 32; i++) {
        drives.left_mv = 9000;
        monitor_step(CONFIG, &state, &estimate, &drives, battery_mv);
    }
    reach(&SOUND, 400, 0, 40);
    says(MONITOR_LEFT, MONITOR_NONE, 0, 0);
    drive(&SOUND);
    says(MONITOR_LEFT, MONITOR_NONE, 0, 0);
}

static void test_monitor_that_is_off_does_nothing(void)
{
    const monitor_config_t off = {.per_sd_q15 = 0};
    const fault_t fault = {.friction_mv = {800, 800}};
    drive(&fault);
    const uint32_t clock_ms = state.clock_ms;
    monitor_step(&off, &state, &estimate, &drives, battery_mv);
    TEST_ASSERT_EQUAL_UINT32(clock_ms, state.clock_ms);
}

static void test_monitor_limits_the_size_of_what_nothing_moves(void)
{
    const monitor_config_t faint = {.per_sd_q15 = 32767,
                                    .friction_q6 = 1,
                                    .friction_mv = 10,
                                    .mv_per_mm_s_q10 = 6824,
                                    .surge_q10 = 2348,
                                    .threshold_q5 = 32};
    estimate.travel_um_q5 = 400 * 3 * 32;
    estimate.speed_mm_s_q4 = 6400;
    drives.left_mv = drives.right_mv = 9000;
    for (int i = 0; i < 20000; i++)
        monitor_step(&faint, &state, &estimate, &drives, battery_mv);
    says(MONITOR_LEFT, MONITOR_FRICTION, 320, 1);
}

static void test_monitor_stays_within_its_bounds_at_the_ends_of_all_ranges(void)
{
    const monitor_config_t wide = {.per_sd_q15 = 32767,
                                   .share_q15 = 32767,
                                   .friction_q6 = MONITOR_MOST_SD_Q6,
                                   .friction_mv = 32767,
                                   .mv_per_mm_s_q10 = 32767,
                                   .surge_q10 = 32767,
                                   .yaw_q10 = 32767,
                                   .half_track_m_q14 = 32767,
                                   .battery_per_sd_q15 = 32767,
                                   .load_q15 = 32767,
                                   .threshold_q5 = 32767};
    for (int i = 0; i < 40000; i++) {
        const int sign = i / 7000 % 2 == 0 ? 1 : -1;
        estimate = (signals_estimate_t){.travel_um_q5 = sign * 2000000000,
                                        .speed_mm_s_q4 = (int16_t)(i % 64 < 32 ? -32767 : 32767),
                                        .yaw_rate_mrad_s = (int16_t)(sign * 32767),
                                        .period_ms = 20,
                                        .valid = true};
        drives = (signals_drive_t){.left_mv = (int16_t)(sign * 32767), .right_mv = -32768};
        battery_mv = (uint16_t)(i < 100 ? 32000 : 0);
        monitor_step(&wide, &state, &estimate, &drives, battery_mv);
        for (int side = 0; side < 2; side++)
            for (int c = 0; c < MONITOR_SIGNATURES; c++) {
                TEST_ASSERT_INT32_WITHIN(1U << 30, 0, state.wheel[side][c].product_q12);
                TEST_ASSERT_TRUE(state.wheel[side][c].square_q12 >= 0);
            }
    }
}

static void test_monitor_is_undecided_where_the_lead_is_small_beside_the_evidence(void)
{
    const fault_t fault = {.braking = {300, 0}};
    for (int i = 0; i < 8; i++) {
        reach(&fault, 300, 0, 400);
        reach(&fault, 330, 0, 400);
    }
    says(MONITOR_LEFT, MONITOR_UNDECIDED, 0, 0);
}

static void test_monitor_takes_sizes_from_the_onset_on(void)
{
    const fault_t small = {.friction_mv = {100, 0}}, large = {.friction_mv = {1000, 0}};
    for (int i = 0; i < 4; i++)
        drive(&small);
    says(MONITOR_LEFT, MONITOR_NONE, 0, 0);
    drive(&large);
    says(MONITOR_LEFT, MONITOR_FRICTION, 1000, 60);
}

static bool left_is_quiet(void)
{
    for (int i = 0; i < MONITOR_SIGNATURES; i++)
        for (int side = 0; side < 2; side++)
            if (state.wheel[0][i].sum_q5[side] >= MONITOR_QUIET_Q5)
                return false;
    return true;
}

static void test_monitor_keeps_a_cause_for_some_blocks_without_evidence(void)
{
    const fault_t fault = {.friction_mv = {500, 0}};
    int quiet_ms = 0;
    drive(&fault);
    reach(&SOUND, 400, -2000, 0);
    for (int i = 0; i < 6000 && state.report[MONITOR_LEFT].cause != MONITOR_NONE; i++) {
        const int at = i % 200; /* serpentines, which say something of every cause */
        step(&SOUND, 400, at < 100 ? -2000 + 40 * at : 6000 - 40 * at);
        quiet_ms += left_is_quiet() ? PERIOD_MS : 0;
    }
    TEST_ASSERT_INT_WITHIN(2U * MONITOR_BLOCK_MS, MONITOR_HOLD_BLOCKS * MONITOR_BLOCK_MS, quiet_ms);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_monitor_says_nothing_of_a_robot_like_the_model);
    RUN_TEST(test_monitor_names_each_cause_of_each_wheel_with_size_and_onset);
    RUN_TEST(test_monitor_names_the_battery_whose_voltage_sags);
    RUN_TEST(test_monitor_takes_the_battery_before_the_first_drive_as_reference);
    RUN_TEST(test_monitor_withdraws_a_cause_that_is_gone);
    RUN_TEST(test_monitor_is_undecided_where_the_drive_tells_nothing_apart);
    RUN_TEST(test_monitor_gives_a_cause_another_name_when_the_evidence_does);
    RUN_TEST(test_monitor_takes_no_block_with_a_bad_estimate);
    RUN_TEST(test_monitor_takes_no_wheel_that_hardly_moves);
    RUN_TEST(test_monitor_needs_more_than_one_wild_block);
    RUN_TEST(test_monitor_that_is_off_does_nothing);
    RUN_TEST(test_monitor_limits_the_size_of_what_nothing_moves);
    RUN_TEST(test_monitor_stays_within_its_bounds_at_the_ends_of_all_ranges);
    RUN_TEST(test_monitor_is_undecided_where_the_lead_is_small_beside_the_evidence);
    RUN_TEST(test_monitor_takes_sizes_from_the_onset_on);
    RUN_TEST(test_monitor_keeps_a_cause_for_some_blocks_without_evidence);
    return UNITY_END();
}
