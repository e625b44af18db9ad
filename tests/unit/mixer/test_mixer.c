#include "mixer/mixer.h"
#include "unity.h"

static const mixer_config_t CONFIG = {.battery_floor_mv = 6000, .max_duty_q15 = 32767};
enum { BATTERY_MV = 9000 };
static mixer_state_t state;
static signals_estimate_t estimate;

void setUp(void)
{
    state = (mixer_state_t){0};
    estimate = (signals_estimate_t){0};
}
void tearDown(void) {}

static signals_drive_t mix_with(const mixer_config_t *config, int16_t surge_mv, int16_t yaw_mv, uint16_t battery_mv)
{
    const signals_effort_t effort = {.surge_mv = surge_mv, .yaw_mv = yaw_mv};
    state.battery_mv = battery_mv;
    signals_drive_t drive;
    mixer_step(config, &state, &effort, &estimate, &drive);
    return drive;
}

static signals_drive_t mix(int16_t surge_mv, int16_t yaw_mv)
{
    return mix_with(&CONFIG, surge_mv, yaw_mv, BATTERY_MV);
}

static void assert_voltages(int left_mv, int right_mv, signals_drive_t drive)
{
    TEST_ASSERT_EQUAL_INT16(left_mv, drive.left_mv);
    TEST_ASSERT_EQUAL_INT16(right_mv, drive.right_mv);
}

static void assert_flags(int surge, int yaw, signals_drive_t drive)
{
    TEST_ASSERT_EQUAL_INT8(surge, drive.surge_saturated);
    TEST_ASSERT_EQUAL_INT8(yaw, drive.yaw_saturated);
}

static void test_mixer_adds_yaw_on_the_left_and_takes_it_on_the_right(void)
{
    const signals_drive_t drive = mix(3000, 1000);
    assert_voltages(4000, 2000, drive);
    assert_flags(0, 0, drive);
}

static void test_mixer_gives_surge_what_yaw_leaves(void)
{
    const signals_drive_t drive = mix(8000, 3000);
    assert_voltages(9000, 3000, drive);
    assert_flags(1, 0, drive);
    assert_flags(-1, 0, mix(-8000, 3000));
}

static void test_mixer_gives_yaw_all_there_is(void)
{
    const signals_drive_t drive = mix(500, 12000);
    assert_voltages(9000, -9000, drive);
    assert_flags(1, 1, drive);
    assert_flags(-1, -1, mix(-500, -12000));
}

static void test_mixer_keeps_yaw_whatever_the_surge(void)
{
    for (int32_t surge = -32768; surge <= 32767; surge += 111) {
        const signals_drive_t drive = mix((int16_t)surge, -2500);
        TEST_ASSERT_EQUAL_INT16(-5000, drive.left_mv - drive.right_mv);
    }
}

static void test_mixer_swaps_motors_when_yaw_turns_over_and_negates_when_both_do(void)
{
    for (int surge = -21000; surge <= 21000; surge += 700)
        for (int yaw = -21000; yaw <= 21000; yaw += 650) {
            const signals_drive_t drive = mix((int16_t)surge, (int16_t)yaw);
            const signals_drive_t mirrored = mix((int16_t)surge, (int16_t)-yaw);
            const signals_drive_t backward = mix((int16_t)-surge, (int16_t)-yaw);
            assert_voltages(drive.right_mv, drive.left_mv, mirrored);
            assert_flags(drive.surge_saturated, -drive.yaw_saturated, mirrored);
            assert_voltages(-drive.left_mv, -drive.right_mv, backward);
            assert_flags(-drive.surge_saturated, -drive.yaw_saturated, backward);
            TEST_ASSERT_EQUAL_INT16(drive.right_q15, mirrored.left_q15);
            TEST_ASSERT_EQUAL_INT16(drive.left_q15, mirrored.right_q15);
            TEST_ASSERT_EQUAL_INT16(-drive.left_q15, backward.left_q15);
            TEST_ASSERT_EQUAL_INT16(-drive.right_q15, backward.right_q15);
        }
}

static void test_mixer_duty_is_voltage_over_battery_to_half_a_unit(void)
{
    for (uint16_t battery = 6000; battery <= 32000; battery = (uint16_t)(battery + 613))
        for (int surge = -6000; surge <= 6000; surge += 37) {
            const signals_drive_t drive = mix_with(&CONFIG, (int16_t)surge, 0, battery);
            TEST_ASSERT_DOUBLE_WITHIN(0.5000001, 32767.0 * surge / battery, drive.left_q15);
        }
}

static void test_mixer_full_battery_voltage_is_duty_32767(void)
{
    for (uint32_t battery = 6000; battery <= 32000; battery++) {
        const signals_drive_t drive = mix_with(&CONFIG, INT16_MAX, 0, (uint16_t)battery);
        TEST_ASSERT_EQUAL_INT16(battery, drive.left_mv);
        TEST_ASSERT_EQUAL_INT16(32767, drive.left_q15);
        TEST_ASSERT_EQUAL_INT16(32767, drive.right_q15);
    }
}

static void test_mixer_same_effort_takes_more_duty_from_a_weaker_battery(void)
{
    TEST_ASSERT_EQUAL_INT16(16384, mix_with(&CONFIG, 4500, 0, 9000).left_q15);
    TEST_ASSERT_EQUAL_INT16(21845, mix_with(&CONFIG, 4500, 0, 6750).left_q15);
}

static void test_mixer_takes_a_battery_below_the_floor_for_the_floor(void)
{
    TEST_ASSERT_EQUAL_INT16(16384, mix_with(&CONFIG, 3000, 0, 0).left_q15);
    TEST_ASSERT_EQUAL_INT16(16384, mix_with(&CONFIG, 3000, 0, 5999).left_q15);
    TEST_ASSERT_EQUAL_INT16(16384, mix_with(&CONFIG, 3000, 0, 6000).left_q15);
    TEST_ASSERT_EQUAL_INT16(16381, mix_with(&CONFIG, 3000, 0, 6001).left_q15);
}

static void test_mixer_takes_a_battery_above_20_v_for_20_v(void)
{
    assert_voltages(32000, 32000, mix_with(&CONFIG, INT16_MAX, 0, 32001));
    assert_voltages(32000, 32000, mix_with(&CONFIG, INT16_MAX, 0, UINT16_MAX));
}

static void test_mixer_never_passes_max_duty(void)
{
    for (int16_t max_duty = 1; max_duty < 32000; max_duty = (int16_t)(max_duty + 501)) {
        const mixer_config_t config = {.battery_floor_mv = 6000, .max_duty_q15 = max_duty};
        for (uint16_t battery = 6000; battery <= 32000; battery = (uint16_t)(battery + 377)) {
            const signals_drive_t drive = mix_with(&config, INT16_MIN, INT16_MIN, battery);
            TEST_ASSERT_GREATER_OR_EQUAL_INT16(-max_duty, drive.left_q15);
            TEST_ASSERT_LESS_OR_EQUAL_INT16(max_duty, drive.right_q15);
            const signals_drive_t straight = mix_with(&config, INT16_MAX, 0, battery);
            TEST_ASSERT_LESS_OR_EQUAL_INT16(max_duty, straight.left_q15);
        }
    }
}

static void test_mixer_saturates_from_the_first_millivolt_that_is_not_there(void)
{
    assert_flags(0, 0, mix(9000, 0));
    assert_flags(1, 0, mix(9001, 0));
    assert_flags(0, 1, mix(0, 9001));
    assert_flags(0, 0, mix(4500, 4500));
    assert_flags(1, 0, mix(4501, 4500));
}

static void test_mixer_turns_on_the_spot_without_surge(void)
{
    const signals_drive_t drive = mix(0, 4500);
    TEST_ASSERT_EQUAL_INT16(16384, drive.left_q15);
    TEST_ASSERT_EQUAL_INT16(-16384, drive.right_q15);
}

static void test_mixer_gives_nothing_where_the_reserve_takes_the_whole_battery(void)
{
    mixer_config_t config = CONFIG;
    config.drive.reserve_mv = 12000;
    const signals_drive_t drive = mix_with(&config, 5000, -3000, BATTERY_MV);
    assert_voltages(0, 0, drive);
    assert_flags(1, -1, drive);
    TEST_ASSERT_EQUAL_INT16(0, drive.left_q15);
    TEST_ASSERT_EQUAL_INT16(0, drive.right_q15);
    assert_voltages(0, 0, mix_with(&config, -5000, 3000, BATTERY_MV));
}

static const drive_config_t FRICTION = {
    .left = {.friction_mv = 500}, .right = {.friction_mv = 700}, .half_track_m_q14 = 1147, .reserve_mv = 700};

static void test_mixer_drives_what_the_motors_need_and_tells_the_model_what_it_wanted(void)
{
    const mixer_config_t config = {.battery_floor_mv = 6000, .max_duty_q15 = 32767, .drive = FRICTION};
    estimate.speed_mm_s_q4 = 16 * 100;
    estimate.yaw_rate_mrad_s = 3000; /* the right side goes backward */
    const signals_drive_t drive = mix_with(&config, 2000, 1000, BATTERY_MV);
    assert_voltages(3000, 1000, drive);
    TEST_ASSERT_INT16_WITHIN(1, 3500 * 32767L / BATTERY_MV, drive.left_q15);
    TEST_ASSERT_INT16_WITHIN(1, 300 * 32767L / BATTERY_MV, drive.right_q15);
}

static void test_mixer_keeps_the_drives_reserve(void)
{
    const mixer_config_t config = {.battery_floor_mv = 6000, .max_duty_q15 = 32767, .drive = FRICTION};
    const signals_drive_t drive = mix_with(&config, 9000, 1000, BATTERY_MV);
    assert_voltages(8300, 6300, drive);
    assert_flags(1, 0, drive);
    TEST_ASSERT_INT16_WITHIN(1, 8800 * 32767L / BATTERY_MV, drive.left_q15);
    const mixer_config_t all = {.battery_floor_mv = 6000, .max_duty_q15 = 32767, .drive = {.reserve_mv = 9000}};
    assert_voltages(0, 0, mix_with(&all, 9000, 1000, BATTERY_MV));
}

static void test_mixer_never_passes_max_duty_whatever_the_motors_need(void)
{
    const mixer_config_t config = {
        .battery_floor_mv = 6000, .max_duty_q15 = 30000, .drive = {.left = {.gain_q15 = 32767}, .deadband_mv = 32000}};
    TEST_ASSERT_INT16_WITHIN(4, 30000, mix_with(&config, 6000, 0, BATTERY_MV).left_q15);
    TEST_ASSERT_INT16_WITHIN(4, -30000, mix_with(&config, -6000, 0, BATTERY_MV).right_q15);
}

static void test_mixer_without_effort_is_off_whatever_the_motors_need(void)
{
    const mixer_config_t config = {.battery_floor_mv = 6000, .max_duty_q15 = 32767, .drive = FRICTION};
    estimate.speed_mm_s_q4 = 16 * 300;
    const signals_drive_t drive = mix_with(&config, 0, 0, BATTERY_MV);
    TEST_ASSERT_EQUAL_INT16(0, drive.left_q15);
    TEST_ASSERT_EQUAL_INT16(0, drive.right_q15);
}

static void test_mixer_mirrors_motors_of_two_kinds(void)
{
    const drive_config_t mirrored_drive = {
        .left = FRICTION.right, .right = FRICTION.left, .half_track_m_q14 = 1147, .reserve_mv = 700};
    const mixer_config_t config = {.battery_floor_mv = 6000, .max_duty_q15 = 32767, .drive = FRICTION};
    const mixer_config_t mirrored = {.battery_floor_mv = 6000, .max_duty_q15 = 32767, .drive = mirrored_drive};
    for (int16_t yaw = -5000; yaw <= 5000; yaw = (int16_t)(yaw + 250))
        for (int16_t rate = -4000; rate <= 4000; rate = (int16_t)(rate + 160)) {
            estimate = (signals_estimate_t){.speed_mm_s_q4 = 2000, .yaw_rate_mrad_s = rate};
            const signals_drive_t one = mix_with(&config, 2500, yaw, BATTERY_MV);
            estimate.yaw_rate_mrad_s = (int16_t)-rate;
            const signals_drive_t other = mix_with(&mirrored, 2500, (int16_t)-yaw, BATTERY_MV);
            TEST_ASSERT_EQUAL_INT16(one.left_q15, other.right_q15);
            TEST_ASSERT_EQUAL_INT16(one.right_q15, other.left_q15);
        }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_mixer_adds_yaw_on_the_left_and_takes_it_on_the_right);
    RUN_TEST(test_mixer_gives_surge_what_yaw_leaves);
    RUN_TEST(test_mixer_gives_yaw_all_there_is);
    RUN_TEST(test_mixer_keeps_yaw_whatever_the_surge);
    RUN_TEST(test_mixer_swaps_motors_when_yaw_turns_over_and_negates_when_both_do);
    RUN_TEST(test_mixer_duty_is_voltage_over_battery_to_half_a_unit);
    RUN_TEST(test_mixer_full_battery_voltage_is_duty_32767);
    RUN_TEST(test_mixer_same_effort_takes_more_duty_from_a_weaker_battery);
    RUN_TEST(test_mixer_takes_a_battery_below_the_floor_for_the_floor);
    RUN_TEST(test_mixer_takes_a_battery_above_20_v_for_20_v);
    RUN_TEST(test_mixer_never_passes_max_duty);
    RUN_TEST(test_mixer_turns_on_the_spot_without_surge);
    RUN_TEST(test_mixer_gives_nothing_where_the_reserve_takes_the_whole_battery);
    RUN_TEST(test_mixer_saturates_from_the_first_millivolt_that_is_not_there);
    RUN_TEST(test_mixer_drives_what_the_motors_need_and_tells_the_model_what_it_wanted);
    RUN_TEST(test_mixer_keeps_the_drives_reserve);
    RUN_TEST(test_mixer_never_passes_max_duty_whatever_the_motors_need);
    RUN_TEST(test_mixer_without_effort_is_off_whatever_the_motors_need);
    RUN_TEST(test_mixer_mirrors_motors_of_two_kinds);
    return UNITY_END();
}
