#include <string.h>

#include "sil/sil.h"
#include "unity.h"

static sil_port_t port;

void setUp(void)
{
    port = (sil_port_t){0};
    sil_bind(&port);
}
void tearDown(void)
{
    sil_bind(NULL);
}

static void test_sil_delivers_what_the_mailbox_holds(void)
{
    hal_imu_t imu;
    uint16_t battery_mv;

    port.clock_ms = 77;
    port.imu = (hal_imu_t){1, -2, 3};
    port.battery_mv = 8123;
    TEST_ASSERT_EQUAL_UINT32(77, hal_clock_ms());
    TEST_ASSERT_EQUAL(HAL_OK, hal_imu_read(&imu));
    TEST_ASSERT_EQUAL_INT16(-2, imu.accel_sway_mm_s2);
    TEST_ASSERT_EQUAL(HAL_OK, hal_battery_read(&battery_mv));
    TEST_ASSERT_EQUAL_UINT16(8123, battery_mv);
}

static void test_sil_leaves_the_output_alone_unless_the_device_is_ok(void)
{
    hal_rotation_t rotation = {5, 6};
    hal_reference_t reference = {.x_um = 9};
    hal_imu_t imu = {7, 7, 7};
    uint16_t battery_mv = 4;

    port.rotation_status = HAL_ABSENT;
    port.reference_status = port.imu_status = port.battery_status = HAL_STALE;
    TEST_ASSERT_EQUAL(HAL_ABSENT, hal_rotation_read(&rotation));
    TEST_ASSERT_EQUAL(HAL_STALE, hal_reference_read(&reference));
    TEST_ASSERT_EQUAL(HAL_STALE, hal_imu_read(&imu));
    TEST_ASSERT_EQUAL(HAL_STALE, hal_battery_read(&battery_mv));
    TEST_ASSERT_EQUAL_UINT16(5, rotation.left);
    TEST_ASSERT_EQUAL_INT32(9, reference.x_um);
    TEST_ASSERT_EQUAL_INT16(7, imu.yaw_rate_mrad_s);
    TEST_ASSERT_EQUAL_UINT16(4, battery_mv);
}

static void test_sil_keeps_and_counts_what_the_motors_got(void)
{
    hal_motors_write(100, -200);
    hal_motors_write(300, -400);
    TEST_ASSERT_EQUAL_INT16(300, port.left_q15);
    TEST_ASSERT_EQUAL_INT16(-400, port.right_q15);
    TEST_ASSERT_EQUAL_UINT32(2, port.motor_writes);
}

static void test_sil_link_takes_no_more_than_there_is_room_for(void)
{
    uint8_t bytes[200];
    memset(bytes, 1, sizeof bytes);
    TEST_ASSERT_EQUAL_UINT16(200, hal_link_write(bytes, 200));
    TEST_ASSERT_EQUAL_UINT16(SIL_LINK_SIZE - 200, hal_link_write(bytes, 200));
    TEST_ASSERT_EQUAL_UINT16(0, hal_link_write(bytes, 1));
}

static void test_sil_link_gives_bytes_in_order_and_once(void)
{
    uint8_t bytes[4] = {0};
    memcpy(port.link_in, "abc", 3);
    port.link_in_size = 3;
    TEST_ASSERT_EQUAL_UINT16(2, hal_link_read(bytes, 2));
    TEST_ASSERT_EQUAL_MEMORY("ab", bytes, 2);
    TEST_ASSERT_EQUAL_UINT16(1, hal_link_read(bytes, 4));
    TEST_ASSERT_EQUAL_UINT8('c', bytes[0]);
    TEST_ASSERT_EQUAL_UINT16(0, hal_link_read(bytes, 4));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_sil_delivers_what_the_mailbox_holds);
    RUN_TEST(test_sil_leaves_the_output_alone_unless_the_device_is_ok);
    RUN_TEST(test_sil_keeps_and_counts_what_the_motors_got);
    RUN_TEST(test_sil_link_takes_no_more_than_there_is_room_for);
    RUN_TEST(test_sil_link_gives_bytes_in_order_and_once);
    return UNITY_END();
}
