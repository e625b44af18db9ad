#include <string.h>

#include "app/telemetry.h"
#include "unity.h"

static step_state_t state;
static step_output_t output;
static uint8_t record[TELEMETRY_SIZE];

void setUp(void)
{
    memset(&state, 0, sizeof state);
    memset(&output, 0, sizeof output);
    memset(record, 0xAA, sizeof record);
}
void tearDown(void) {}

static uint32_t get(int offset, int size)
{
    uint32_t value = 0;
    for (int i = 0; i < size; i++)
        value |= (uint32_t)record[offset + i] << (8 * i);
    return value;
}

static void test_telemetry_is_little_endian_at_the_stated_offsets(void)
{
    state.mode.mode = MODE_RUN;
    state.mode.fault = MODE_LEG_OVERSHOT;
    state.mode.guidance.phase = LOS_TURN;
    state.mode.guidance.waypoint = 5;
    state.mode.guidance.cross_track_mm = -321;
    state.mode.demand.speed_mm_s_q4 = 4800;
    state.mode.demand.heading_bam16 = 40000;
    output.state.x_um = -1234567;
    output.state.y_um = 7654321;
    output.state.heading_bam16 = 50000;
    output.state.speed_mm_s_q4 = -4321;
    output.state.yaw_rate_mrad_s = -99;
    output.effort.surge_mv = 4500;
    output.effort.yaw_mv = -700;
    state.drive.left_q15 = 12345;
    state.drive.right_q15 = -23456;
    state.battery_mv = 8765;

    telemetry_pack(0x01020304, &state, &output, record);

    TEST_ASSERT_EQUAL_HEX32(0x01020304, get(0, 4));
    TEST_ASSERT_EQUAL_UINT8(MODE_RUN, record[4]);
    TEST_ASSERT_EQUAL_UINT8(MODE_LEG_OVERSHOT, record[5]);
    TEST_ASSERT_EQUAL_UINT8(LOS_TURN, record[6]);
    TEST_ASSERT_EQUAL_UINT8(5, record[7]);
    TEST_ASSERT_EQUAL_INT32(-1234567, (int32_t)get(8, 4));
    TEST_ASSERT_EQUAL_INT32(7654321, (int32_t)get(12, 4));
    TEST_ASSERT_EQUAL_UINT16(50000, get(16, 2));
    TEST_ASSERT_EQUAL_INT16(-4321, (int16_t)get(18, 2));
    TEST_ASSERT_EQUAL_INT16(-99, (int16_t)get(20, 2));
    TEST_ASSERT_EQUAL_INT16(4800, (int16_t)get(22, 2));
    TEST_ASSERT_EQUAL_UINT16(40000, get(24, 2));
    TEST_ASSERT_EQUAL_INT16(-321, (int16_t)get(26, 2));
    TEST_ASSERT_EQUAL_INT16(4500, (int16_t)get(28, 2));
    TEST_ASSERT_EQUAL_INT16(-700, (int16_t)get(30, 2));
    TEST_ASSERT_EQUAL_INT16(12345, (int16_t)get(32, 2));
    TEST_ASSERT_EQUAL_INT16(-23456, (int16_t)get(34, 2));
    TEST_ASSERT_EQUAL_UINT16(8765, get(36, 2));
    TEST_ASSERT_EQUAL_UINT16(0, get(38, 2));
}

static void test_telemetry_flags_are_one_bit_each(void)
{
    output.state.at_rest = true;
    state.drive.surge_saturated = -1;
    telemetry_pack(0, &state, &output, record);
    TEST_ASSERT_EQUAL_HEX8(1 | 4, record[38]);

    output.state = (signals_state_t){.valid = true};
    state.drive = (signals_drive_t){.yaw_saturated = 1};
    telemetry_pack(0, &state, &output, record);
    TEST_ASSERT_EQUAL_HEX8(2 | 8, record[38]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_telemetry_is_little_endian_at_the_stated_offsets);
    RUN_TEST(test_telemetry_flags_are_one_bit_each);
    return UNITY_END();
}
