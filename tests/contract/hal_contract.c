/* hal_contract.c: the contract suite. It tests what hal.h promises, for every port. */
#include <stddef.h>

#include "port.h"
#include "unity.h"
#include "wire/codecs_gen.h"

static const port_world_t WORLD = {
    .imu = {1, -2, 3}, .rotation = {65535, 7}, .battery_mv = 8765, .reference = {-123456, 654321, 40000, -321, 99}};
static const port_world_t ENDS = {.imu = {32767, -32767, 32767},
                                  .rotation = {0, 65535},
                                  .battery_mv = 20000,
                                  .reference = {2000000000, -2000000000, 65535, -32767, 32767}};

/* RULE states a demand of hal.h, before its checks. A check that fails is printed with its rule. An AVR chip has no RAM
 * for the texts: there the number of the failed line leads to the rule above it. */
#ifdef __AVR__
#define RULE(text)
#elif defined(UNITY_FRAMEWORK_H)
static const char *rule;
#define RULE(text) (rule = (text))
#else
#define RULE(text) (unity_rule = (text))
#endif

void setUp(void)
{
    port_begin();
}
void tearDown(void)
{
    port_end();
#ifdef UNITY_FRAMEWORK_H
    if (Unity.CurrentTestFailed && rule != NULL) {
        UnityPrint(". Broken rule: ");
        UnityPrint(rule);
    }
    rule = NULL;
#endif
}

enum { ALL = PORT_IMU | PORT_ROTATION | PORT_BATTERY | PORT_REFERENCE };

static void gives(const port_world_t *shown, unsigned devices)
{
    const port_world_t resolved = port_resolved(shown);
    const port_world_t *const world = &resolved;
    hal_imu_t imu;
    hal_rotation_t rotation;
    hal_reference_t reference;
    uint16_t battery_mv;

    if (devices & PORT_IMU) {
        TEST_ASSERT_EQUAL(HAL_OK, hal_imu_read(&imu));
        TEST_ASSERT_EQUAL_INT16(world->imu.accel_surge_mm_s2, imu.accel_surge_mm_s2);
        TEST_ASSERT_EQUAL_INT16(world->imu.accel_sway_mm_s2, imu.accel_sway_mm_s2);
        TEST_ASSERT_EQUAL_INT16(world->imu.yaw_rate_mrad_s, imu.yaw_rate_mrad_s);
    }
    if (devices & PORT_GYRO) {
        TEST_ASSERT_EQUAL(HAL_PARTLY, hal_imu_read(&imu));
        TEST_ASSERT_EQUAL_INT16(world->imu.yaw_rate_mrad_s, imu.yaw_rate_mrad_s);
    }
    if (devices & PORT_ROTATION) {
        TEST_ASSERT_EQUAL(HAL_OK, hal_rotation_read(&rotation));
        TEST_ASSERT_EQUAL_UINT16(world->rotation.left, rotation.left);
        TEST_ASSERT_EQUAL_UINT16(world->rotation.right, rotation.right);
    }
    if (devices & PORT_BATTERY) {
        TEST_ASSERT_EQUAL(HAL_OK, hal_battery_read(&battery_mv));
        TEST_ASSERT_EQUAL_UINT16(world->battery_mv, battery_mv);
    }
    if (devices & PORT_REFERENCE) {
        TEST_ASSERT_EQUAL(HAL_OK, hal_reference_read(&reference));
        TEST_ASSERT_EQUAL_INT32(world->reference.x_um, reference.x_um);
        TEST_ASSERT_EQUAL_INT32(world->reference.y_um, reference.y_um);
        TEST_ASSERT_EQUAL_UINT16(world->reference.heading_bam16, reference.heading_bam16);
        TEST_ASSERT_EQUAL_INT16(world->reference.speed_mm_s_q4, reference.speed_mm_s_q4);
        TEST_ASSERT_EQUAL_INT16(world->reference.yaw_rate_mrad_s, reference.yaw_rate_mrad_s);
    }
}

/* Every read returns this status and leaves its argument as it was. */
static void gives_nothing(hal_status_t status, unsigned devices)
{
    hal_imu_t imu = {11, 12, 13};
    hal_rotation_t rotation = {14, 15};
    hal_reference_t reference = {16, 17, 18, 19, 20};
    uint16_t battery_mv = 21;

    if (devices & (PORT_IMU | PORT_GYRO))
        TEST_ASSERT_EQUAL(status, hal_imu_read(&imu));
    if (devices & PORT_ROTATION)
        TEST_ASSERT_EQUAL(status, hal_rotation_read(&rotation));
    if (devices & PORT_BATTERY)
        TEST_ASSERT_EQUAL(status, hal_battery_read(&battery_mv));
    if (devices & PORT_REFERENCE)
        TEST_ASSERT_EQUAL(status, hal_reference_read(&reference));
    TEST_ASSERT_EQUAL_INT16(13, imu.yaw_rate_mrad_s);
    TEST_ASSERT_EQUAL_UINT16(15, rotation.right);
    TEST_ASSERT_EQUAL_INT32(16, reference.x_um);
    TEST_ASSERT_EQUAL_UINT16(21, battery_mv);
}

/* Called if the test has passed as far as this port goes. Reports what the port cannot tell. */
static void ignore_what_it_cannot_tell(hal_status_t status)
{
    if (port_why_not(status) != NULL)
        TEST_IGNORE_MESSAGE(port_why_not(status));
}

static void test_readings_are_what_the_world_shows_to_the_last_unit(void)
{
    RULE("a read gives the newest value, in the unit and the range of hal.h");
    port_step(3, port_devices(), 0, &WORLD);
    gives(&WORLD, port_devices());
    RULE("a second read in the same step gives the same value again");
    gives(&WORLD, port_devices());
    RULE("a read gives the newest value, up to the ends of its range");
    port_step(3, port_devices(), 0, &ENDS);
    gives(&ENDS, port_devices());
}

static void test_a_silent_device_is_stale_and_recovers(void)
{
    port_step(3, port_devices(), 0, &WORLD);
    RULE("without a new value a read returns HAL_STALE and leaves its argument as it was");
    port_step(3, 0, port_devices(), &WORLD);
    gives_nothing(HAL_STALE, port_tells(HAL_STALE));
    RULE("after HAL_STALE a read gives the next new value");
    port_step(3, port_devices(), 0, &ENDS);
    gives(&ENDS, port_devices());
    ignore_what_it_cannot_tell(HAL_STALE);
}

static void test_one_silent_device_does_not_silence_the_others(void)
{
    for (unsigned device = 1; device <= PORT_GYRO; device <<= 1) {
        if ((device & port_tells(HAL_STALE)) == 0)
            continue;
        RULE("a device without a new value leaves the other devices as they are");
        port_step(3, port_devices() & ~device, device, &WORLD);
        gives(&WORLD, port_devices() & ~device);
        gives_nothing(HAL_STALE, device);
    }
}

static void test_a_device_that_is_not_there_is_absent(void)
{
    unsigned never = ALL & ~port_devices();

    if (port_devices() & PORT_GYRO)
        never &= ~(unsigned)PORT_IMU;
    RULE("a device that is not there returns HAL_ABSENT and leaves its argument as it was");
    port_step(3, 0, 0, &WORLD);
    gives_nothing(HAL_ABSENT, port_tells(HAL_ABSENT) | never);
    ignore_what_it_cannot_tell(HAL_ABSENT);
}

static void test_the_clock_follows_the_time_that_passes(void)
{
    port_step(3, port_devices(), 0, &WORLD);
    const uint32_t began_ms = hal_clock_ms();
    RULE("the clock counts milliseconds and never goes back");
    uint32_t before_ms = began_ms;
    for (int i = 0; i < 100; i++) {
        port_step(3, port_devices(), 0, &WORLD);
        TEST_ASSERT_GREATER_OR_EQUAL_UINT32(before_ms, hal_clock_ms());
        before_ms = hal_clock_ms();
    }
    TEST_ASSERT_UINT32_WITHIN(2, 300, before_ms - began_ms);
}

static void test_the_motors_get_what_is_written_and_hold_it(void)
{
    static const int16_t DUTIES[][2] = {{0, 0}, {1, -1}, {32767, -32767}, {-32767, 32767}, {-12345, 6789}, {0, 0}};
    int16_t left, right;

    RULE("a duty, -32767..32767 for -1..1, acts at once and holds until the next call");
    port_step(3, port_devices(), 0, &WORLD);
    for (size_t i = 0; i < sizeof DUTIES / sizeof *DUTIES; i++) {
        hal_motors_write(DUTIES[i][0], DUTIES[i][1]);
        for (int step = 0; step < 3; step++) {
            port_motors(&left, &right);
            TEST_ASSERT_EQUAL_INT16(port_resolved_duty(DUTIES[i][0]), left);
            TEST_ASSERT_EQUAL_INT16(port_resolved_duty(DUTIES[i][1]), right);
            port_step(3, port_devices(), 0, &WORLD);
        }
    }
}

static message_t numbered(uint8_t number)
{
    message_t message = {.id = (uint16_t)(WIRE_TELEMETRY_X_FRAME_ID + number % 7), .size = 8};
    for (uint8_t i = 0; i < 8; i++)
        message.data[i] = (uint8_t)(number + i);
    return message;
}

static void same(const message_t *wanted, const message_t *got)
{
    TEST_ASSERT_EQUAL_HEX16(wanted->id, got->id);
    TEST_ASSERT_EQUAL_UINT8(wanted->size, got->size);
    TEST_ASSERT_EQUAL_MEMORY(wanted->data, got->data, 8);
}

static void test_messages_leave_whole_in_order_and_once(void)
{
    message_t got;
    RULE("hal_link_write() has room for eight messages in a step");
    for (uint8_t i = 0; i < 8; i++) {
        const message_t message = numbered(i);
        TEST_ASSERT_TRUE(hal_link_write(&message));
    }
    RULE("messages leave whole, in order and once");
    for (uint8_t i = 0; i < 8; i++) {
        const message_t message = numbered(i);
        TEST_ASSERT_TRUE(port_host_receive(&got));
        same(&message, &got);
    }
    TEST_ASSERT_FALSE(port_host_receive(&got));
}

static void test_messages_come_whole_in_order_and_once(void)
{
    message_t got;
    RULE("hal_link_read() returns false where there is no message");
    TEST_ASSERT_FALSE(hal_link_read(&got));
    RULE("messages come whole, in order and once");
    TEST_ASSERT_TRUE(port_room() > 0);
    for (uint8_t first = 0; first < 8; first = (uint8_t)(first + port_room())) {
        for (uint8_t i = 0; i < port_room(); i++) {
            const message_t message = numbered((uint8_t)(first + i));
            TEST_ASSERT_TRUE(port_host_send(&message));
        }
        for (uint8_t i = 0; i < port_room(); i++) {
            const message_t message = numbered((uint8_t)(first + i));
            TEST_ASSERT_TRUE(hal_link_read(&got));
            same(&message, &got);
        }
        TEST_ASSERT_FALSE(hal_link_read(&got));
    }
}

static void test_a_link_that_is_full_refuses_and_recovers(void)
{
    const message_t message = numbered(1);
    message_t got;
    int written = 0, received = 0;

    RULE("hal_link_write() returns false where there is no room");
    while (written < 10000 && hal_link_write(&message))
        written++;
    TEST_ASSERT_LESS_THAN_INT(10000, written);
    TEST_ASSERT_FALSE(hal_link_write(&message));
    RULE("a link that was full has lost nothing that it took, and takes messages again");
    while (port_host_receive(&got)) {
        same(&message, &got);
        received++;
    }
    TEST_ASSERT_EQUAL_INT(written, received);
    TEST_ASSERT_TRUE(hal_link_write(&message));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_readings_are_what_the_world_shows_to_the_last_unit);
    RUN_TEST(test_a_silent_device_is_stale_and_recovers);
    RUN_TEST(test_one_silent_device_does_not_silence_the_others);
    RUN_TEST(test_a_device_that_is_not_there_is_absent);
    RUN_TEST(test_the_clock_follows_the_time_that_passes);
    RUN_TEST(test_the_motors_get_what_is_written_and_hold_it);
    RUN_TEST(test_messages_leave_whole_in_order_and_once);
    RUN_TEST(test_messages_come_whole_in_order_and_once);
    RUN_TEST(test_a_link_that_is_full_refuses_and_recovers);
    return UNITY_END();
}
