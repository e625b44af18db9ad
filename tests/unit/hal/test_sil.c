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
    const message_t message = {.id = 5};
    for (int i = 0; i < SIL_LINK_SIZE; i++)
        TEST_ASSERT_TRUE(hal_link_write(&message));
    TEST_ASSERT_FALSE(hal_link_write(&message));
    TEST_ASSERT_EQUAL_UINT16(SIL_LINK_SIZE, port.link_out_size);
}

static void test_sil_link_gives_messages_in_order_and_once(void)
{
    message_t message = {0};
    port.link_in[0] = (message_t){.id = 1, .size = 2, .data = {3, 4}};
    port.link_in[1] = (message_t){.id = 2};
    port.link_in_size = 2;
    TEST_ASSERT_TRUE(hal_link_read(&message));
    TEST_ASSERT_EQUAL_UINT16(1, message.id);
    TEST_ASSERT_EQUAL_UINT8(4, message.data[1]);
    TEST_ASSERT_TRUE(hal_link_read(&message));
    TEST_ASSERT_EQUAL_UINT16(2, message.id);
    TEST_ASSERT_FALSE(hal_link_read(&message));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_sil_delivers_what_the_mailbox_holds);
    RUN_TEST(test_sil_leaves_the_output_alone_unless_the_device_is_ok);
    RUN_TEST(test_sil_keeps_and_counts_what_the_motors_got);
    RUN_TEST(test_sil_link_takes_no_more_than_there_is_room_for);
    RUN_TEST(test_sil_link_gives_messages_in_order_and_once);
    return UNITY_END();
}
