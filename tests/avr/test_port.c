/* test_port.c: what the AVR port promises beyond the contract: its safe states, and what it counts.
 *
 * Some tests end in a reset. The program then begins anew, and goes on with the next test; the world counts the resets.
 */
#define F_CPU 16000000UL
#include <avr/interrupt.h>
#include <avr/io.h>
#include <stddef.h>
#include <stdlib.h>
#include <util/delay.h>

#include "avr/analogue.h"
#include "avr/board.h"
#include "avr/clock.h"
#include "avr/digital.h"
#include "avr/guard.h"
#include "avr/motors.h"
#include "avr/rotation.h"
#include "avr/serial.h"
#include "port.h"
#include "port_avr.h"
#include "unity.h"
#include "wire/codecs_gen.h"

/* bridge_state_t of sim_host/avr/bridge.h, and chip_fault_t of chip.h. */
enum { COASTS, SHORTED, FORWARD, BACKWARD };
enum { CONVERTER_STUCK = 2, ENCODER_NOISE = 4, IMU_UNPOWERED = 6, BUS_HELD = 7 };

static const port_world_t WORLD = {.imu = {1000, -1000, 500}, .rotation = {0, 0}, .battery_mv = 9000};

void setUp(void)
{
    port_begin();
}
void tearDown(void) {}

static void drives_are(int16_t left, int16_t right)
{
    port_ask(WORLD_TELL);
    TEST_ASSERT_EQUAL_INT16(left, mailbox.parts[0]);
    TEST_ASSERT_EQUAL_INT16(right, mailbox.parts[1]);
}

static void set_fault(uint8_t fault, uint8_t value)
{
    mailbox.fault = fault;
    mailbox.size = value;
    port_ask(WORLD_FAULT);
}

static void wait_ticks(uint8_t ticks)
{
    for (; ticks > 0; ticks--)
        (void)clock_wait();
}

static void test_motors_coast_until_they_are_written(void)
{
    drives_are(COASTS, COASTS);
    hal_motors_write(0, 0);
    drives_are(SHORTED, SHORTED);
    hal_motors_write(32767, -32767);
    wait_ticks(1);
    drives_are(FORWARD, BACKWARD);
    motors_coast();
    drives_are(COASTS, COASTS);
}

static void test_a_stuck_converter_makes_readings_stale_and_recovers(void)
{
    hal_imu_t imu;
    uint16_t battery_mv;

    port_step(3, PORT_IMU | PORT_GYRO | PORT_BATTERY, 0, &WORLD);
    TEST_ASSERT_TRUE(hal_imu_read(&imu) != HAL_STALE);
    TEST_ASSERT_EQUAL(HAL_OK, hal_battery_read(&battery_mv));
    set_fault(CONVERTER_STUCK, 1);
    wait_ticks(4);
    TEST_ASSERT_EQUAL(BOARD_IMU == BOARD_ANALOGUE, hal_imu_read(&imu) == HAL_STALE);
    TEST_ASSERT_EQUAL(HAL_STALE, hal_battery_read(&battery_mv));
    TEST_ASSERT_TRUE(analogue_faults() > 0);
    set_fault(CONVERTER_STUCK, 0);
    wait_ticks(3);
    TEST_ASSERT_TRUE(hal_imu_read(&imu) != HAL_STALE);
}

#if BOARD_IMU != BOARD_ANALOGUE
enum { START = 100 / BOARD_TICK_MS + 10 }; /* ticks in which a sensor is set up, and gives data */

/* Its registers are those of power-on then: another range, and asleep. */
static void test_a_digital_imu_that_lost_its_supply_is_set_up_again(void)
{
    const port_world_t resolved = port_resolved(&WORLD);
    const uint16_t before = digital_faults();
    hal_imu_t imu;

    port_step(3, PORT_IMU | PORT_GYRO | PORT_BATTERY, 0, &WORLD);
    TEST_ASSERT_TRUE(hal_imu_read(&imu) != HAL_STALE);
    set_fault(IMU_UNPOWERED, 1);
    wait_ticks(3);
    TEST_ASSERT_EQUAL(HAL_STALE, hal_imu_read(&imu));
    set_fault(IMU_UNPOWERED, 0);
    wait_ticks(START);
    TEST_ASSERT_TRUE(hal_imu_read(&imu) != HAL_STALE);
    TEST_ASSERT_EQUAL_INT16(resolved.imu.yaw_rate_mrad_s, imu.yaw_rate_mrad_s);
    TEST_ASSERT_TRUE(digital_faults() > before + 2);
}

/* So short that no transfer meets it: the sensor answers, and sleeps. */
static void test_a_digital_imu_that_fell_asleep_is_set_up_again(void)
{
    hal_imu_t imu;

    wait_ticks(1);
    set_fault(IMU_UNPOWERED, 1);
    set_fault(IMU_UNPOWERED, 0);
    wait_ticks(3);
    TEST_ASSERT_EQUAL(HAL_STALE, hal_imu_read(&imu));
    wait_ticks(2 * START);
    TEST_ASSERT_TRUE(hal_imu_read(&imu) != HAL_STALE);
}

static void test_a_bus_that_is_held_is_freed(void)
{
    const uint16_t before = digital_faults();
    hal_imu_t imu;

    wait_ticks(1);
    TEST_ASSERT_TRUE(hal_imu_read(&imu) != HAL_STALE);
    set_fault(BUS_HELD, 1);
    wait_ticks(START);
    TEST_ASSERT_TRUE(hal_imu_read(&imu) != HAL_STALE);
    TEST_ASSERT_TRUE(digital_faults() > before);
}
#endif

static void test_lost_bytes_are_counted_and_told(void)
{
    static const uint8_t BYTES[MAILBOX_BYTES] = {1, 2, 3};
    const message_t heartbeat = {.id = WIRE_HEARTBEAT_FRAME_ID, .size = 8};
    message_t message;

    for (uint8_t i = 0; i < 5; i++) /* 80 bytes, and room for 63 */
        port_host_bytes(BYTES, MAILBOX_BYTES);
    TEST_ASSERT_EQUAL_UINT16(5 * MAILBOX_BYTES - (SERIAL_IN - 1), serial_overruns());
    while (hal_link_read(&message)) {
    }
    TEST_ASSERT_TRUE(hal_link_write(&heartbeat));
    TEST_ASSERT_TRUE(port_host_receive(&message));
    TEST_ASSERT_TRUE(port_host_receive(&message));
    TEST_ASSERT_EQUAL_HEX16(WIRE_FAULTS_FRAME_ID, message.id);
    TEST_ASSERT_EQUAL_UINT16(serial_overruns(), message_get(&message.data[WIRE_FAULTS_LOST_AT]));
    TEST_ASSERT_TRUE(message_get(&message.data[WIRE_FAULTS_BAD_AT]) > 0);
    TEST_ASSERT_TRUE(port_host_receive(&message));
    TEST_ASSERT_EQUAL_HEX16(WIRE_BOARD_FRAME_ID, message.id);
    TEST_ASSERT_EQUAL_UINT16(serial_overruns(), message_get(&message.data[WIRE_BOARD_OVERRUNS_AT]));
}

#ifdef AVR_ROTATION
/* A false pulse on one line counts up and down again. */
static void test_false_pulses_do_not_move_a_wheel(void)
{
    hal_rotation_t before, after;

    TEST_ASSERT_EQUAL(HAL_OK, hal_rotation_read(&before));
    set_fault(ENCODER_NOISE, 200);
    wait_ticks(100);
    set_fault(ENCODER_NOISE, 0);
    wait_ticks(1);
    TEST_ASSERT_EQUAL(HAL_OK, hal_rotation_read(&after));
    TEST_ASSERT_EQUAL_UINT16(before.left, after.left);
    TEST_ASSERT_EQUAL_UINT16(before.right, after.right);
    TEST_ASSERT_EQUAL_UINT16(0, rotation_errors());
}

/* The program turns both lines of the left sensor at a time: it makes them outputs, which read as they are written. */
static void test_an_impossible_change_is_an_error_and_no_count(void)
{
    hal_rotation_t before, after;

    TEST_ASSERT_EQUAL(HAL_OK, hal_rotation_read(&before));
#ifdef BOARD_ATMEGA2560
    PORTK = 0;
    DDRK = 3;
    wait_ticks(1);
    TEST_ASSERT_EQUAL(HAL_OK, hal_rotation_read(&before));
    PORTK = 3;
#else
    PORTD &= (uint8_t) ~(3U << 2);
    DDRD |= 3U << 2;
    wait_ticks(1);
    TEST_ASSERT_EQUAL(HAL_OK, hal_rotation_read(&before));
    PORTD |= 3U << 2;
#endif
    wait_ticks(1);
    TEST_ASSERT_EQUAL(HAL_OK, hal_rotation_read(&after));
    TEST_ASSERT_EQUAL_UINT16(before.left, after.left);
    TEST_ASSERT_EQUAL_UINT16(1, rotation_errors());
}
#endif

/* Three tests that end in a reset: the motors are on, and then something happens. */
static void drive(void)
{
    guard_start();
    hal_motors_write(32767, 32767);
    wait_ticks(1);
    drives_are(FORWARD, FORWARD);
}

static void wait_for_reset(void)
{
    for (uint8_t ticks = 0; ticks < 100; ticks++) {
        (void)clock_wait();
        guard_tick();
    }
    TEST_ASSERT_TRUE(false);
}

static void test_a_silent_program_is_reset(void)
{
    drive();
    wait_ticks(100); /* without guard_tick() */
    TEST_ASSERT_TRUE(false);
}

static void test_a_stack_that_is_too_deep_is_reset(void)
{
    extern uint8_t __heap_start;

    drive();
    __heap_start = 0;
    wait_for_reset();
}

static void test_an_unexpected_interrupt_stops_the_motors_at_once(void)
{
    drive();
    TCCR0B = 1U << CS00; /* nobody handles the overflow of timer 0 */
    TIMSK0 = 1U << TOIE0;
    wait_for_reset();
}

static void (*const ENDS[])(void) = {test_a_silent_program_is_reset, test_a_stack_that_is_too_deep_is_reset,
                                     test_an_unexpected_interrupt_stops_the_motors_at_once};
enum { ENDS_COUNT = sizeof ENDS / sizeof ENDS[0] };

static void test_after_a_reset_the_motors_coast_and_the_cause_is_told(void)
{
    const message_t heartbeat = {.id = WIRE_HEARTBEAT_FRAME_ID, .size = 8};
    message_t message;

    TEST_ASSERT_TRUE(hal_link_write(&heartbeat));
    for (uint8_t i = 0; i < 3; i++)
        TEST_ASSERT_TRUE(port_host_receive(&message));
    TEST_ASSERT_EQUAL_HEX16(WIRE_BOARD_FRAME_ID, message.id);
    TEST_ASSERT_EQUAL_UINT8(GUARD_WATCHDOG, message.data[WIRE_BOARD_STARTED_BY_AT]);
    TEST_ASSERT_EQUAL_UINT8(GUARD_WATCHDOG, guard_cause());
    TEST_ASSERT_FALSE(guard_may_start());
    drives_are(COASTS, COASTS);
    TEST_ASSERT_EQUAL_UINT8(mailbox.resets == ENDS_COUNT ? COASTS : FORWARD, mailbox.bytes[0]);
    TEST_ASSERT_EQUAL_UINT8(mailbox.bytes[0], mailbox.bytes[1]);
}

int main(void)
{
    uint8_t resets;

    _delay_ms(2); /* the world looks at the drives every ms */
    port_ask(WORLD_TELL);
    resets = mailbox.resets;
    if (resets > 0)
        RUN_TEST(test_after_a_reset_the_motors_coast_and_the_cause_is_told);
    if (resets == 0) {
        TEST_ASSERT_TRUE(guard_may_start());
        RUN_TEST(test_motors_coast_until_they_are_written);
        RUN_TEST(test_lost_bytes_are_counted_and_told);
#ifdef AVR_ROTATION
        RUN_TEST(test_false_pulses_do_not_move_a_wheel);
        RUN_TEST(test_an_impossible_change_is_an_error_and_no_count);
#endif
        RUN_TEST(test_a_stuck_converter_makes_readings_stale_and_recovers);
#if BOARD_IMU != BOARD_ANALOGUE
        RUN_TEST(test_a_digital_imu_that_lost_its_supply_is_set_up_again);
        RUN_TEST(test_a_digital_imu_that_fell_asleep_is_set_up_again);
        RUN_TEST(test_a_bus_that_is_held_is_freed);
#endif
    }
    if (resets < ENDS_COUNT) {
        setUp();
        ENDS[resets]();
    }
    return UNITY_END();
}
