/* test_port.c: what the drivers of hal/rcx do beyond the contract of every port, beside brickOS's own kernel. */
#include <conio.h>
#include <dmotor.h>
#include <unistd.h>

#include "port.h"
#include "port_rcx.h"
#include "rcx/test_link.h"
#include "targets/rcx/panel.h"
#include "unity.h"

enum { DISPLAY_SIZE = 9 };

extern volatile uint8_t motor_controller;
extern uint8_t display_memory[DISPLAY_SIZE];

void setUp(void)
{
    port_begin();
}
void tearDown(void)
{
    port_end();
}

static void test_port_room_for_a_program(void)
{
    world_say("largest block ");
    world_say_number(world_room);
    world_say("\n");
    TEST_ASSERT_TRUE(world_room > 14000);
}

static void test_port_motors_are_symmetric_and_grow_with_duty(void)
{
    int16_t a, c, mirrored_a, mirrored_c, before = 0;

    for (int16_t duty = 128; duty > 0 && duty <= 32640; duty += 2032) {
        hal_motors_write(duty, (int16_t)-duty);
        world_pulses(&a, &c);
        hal_motors_write((int16_t)-duty, duty);
        world_pulses(&mirrored_a, &mirrored_c);
        TEST_ASSERT_EQUAL_INT16(a, -c);
        TEST_ASSERT_EQUAL_INT16(a, -mirrored_a);
        TEST_ASSERT_EQUAL_INT16(a, mirrored_c);
        TEST_ASSERT_TRUE(a > before);
        before = a;
    }
}

static void test_port_zero_duty_shorts_the_motors_and_pulses_float_between(void)
{
    bool floats = false;

    hal_motors_write(0, 0);
    for (uint16_t ms = 0; ms < 256; ms++) {
        world_run(1);
        TEST_ASSERT_EQUAL_UINT8(0xC3, motor_controller);
    }
    hal_motors_write(10923, -10923);
    for (uint8_t ms = 0; ms < 8; ms++) {
        world_run(1);
        floats = floats || motor_controller == 0;
    }
    TEST_ASSERT_TRUE(floats);
    hal_motors_write(0, 0);
}

static void test_port_gyro_reads_nothing_at_the_rails_and_mirrors_about_its_middle(void)
{
    hal_imu_t above, below;

    for (uint8_t input = 1; input <= 3; input++)
        world_convert(input, 512);
    TEST_ASSERT_TRUE(hal_imu_read(&above) != HAL_STALE);
    TEST_ASSERT_EQUAL_INT16(0, above.yaw_rate_mrad_s);
    world_convert(2, 0);
    TEST_ASSERT_EQUAL(HAL_STALE, hal_imu_read(&above));
    world_convert(2, 1023);
    TEST_ASSERT_EQUAL(HAL_STALE, hal_imu_read(&above));
    world_convert(2, 513);
    TEST_ASSERT_TRUE(hal_imu_read(&above) != HAL_STALE);
    TEST_ASSERT_EQUAL_INT16(20, above.yaw_rate_mrad_s);
    world_convert(2, 1022);
    (void)hal_imu_read(&above);
    TEST_ASSERT_EQUAL_INT16(10429, above.yaw_rate_mrad_s); /* 510 counts of 600 degrees/s / 512 */
    world_convert(2, 2);
    (void)hal_imu_read(&below);
    TEST_ASSERT_EQUAL_INT16(-10429, below.yaw_rate_mrad_s);
}

#ifdef RCX_ROTATION
/* A LEGO rotation sensor goes through four voltages; each change of voltage is a count. */
static void test_port_rotation_counts_as_brickos_does(void)
{
    static const uint16_t forward[] = {960, 832, 384, 576}; /* each in the middle of brickOS's range of the voltage */
    hal_rotation_t before, after;

    world_convert(1, forward[0]);
    world_convert(3, forward[0]);
    world_converted();
    TEST_ASSERT_EQUAL(HAL_OK, hal_rotation_read(&before));
    for (uint8_t i = 1; i <= 9; i++) {
        world_convert(1, forward[i % 4]);
        world_convert(3, forward[-i & 3]);
        world_converted();
    }
    TEST_ASSERT_EQUAL(HAL_OK, hal_rotation_read(&after));
    TEST_ASSERT_EQUAL_UINT16((uint16_t)(before.left + 9), after.left);
    TEST_ASSERT_EQUAL_UINT16((uint16_t)(before.right - 9), after.right);
}
#endif

#ifndef RCX_ROTATION
static void test_port_accelerometer_reads_nothing_at_the_rails_and_mirrors_about_its_middle(void)
{
    hal_imu_t imu;

    world_convert(2, 512);
    world_convert(1, 1022);
    world_convert(3, 2);
    TEST_ASSERT_EQUAL(HAL_OK, hal_imu_read(&imu));
    TEST_ASSERT_EQUAL_INT16(19543, imu.accel_surge_mm_s2); /* 510 counts of 2 g / 512 */
    TEST_ASSERT_EQUAL_INT16(-19543, imu.accel_sway_mm_s2);
    world_convert(3, 1023);
    TEST_ASSERT_EQUAL(HAL_STALE, hal_imu_read(&imu));
    world_convert(3, 512);
    world_convert(1, 0);
    TEST_ASSERT_EQUAL(HAL_STALE, hal_imu_read(&imu));
}
#endif

/* Compares with a second sum of 43988 / 1560, up the whole range and down again. */
static void test_port_battery_follows_brickos_formula(void)
{
    uint16_t mv = 0, over = 0, read;

    for (uint16_t raw = 1; raw <= 709; raw++) { /* 20 V */
        over = (uint16_t)(over + 43988U % 1560U);
        mv = (uint16_t)(mv + 43988U / 1560U + (over >= 1560 ? 1 : 0));
        over = over >= 1560 ? (uint16_t)(over - 1560) : over;
        world_convert(0, raw);
        TEST_ASSERT_EQUAL(HAL_OK, hal_battery_read(&read));
        TEST_ASSERT_EQUAL_UINT16(mv, read);
    }
    world_convert(0, 1);
    TEST_ASSERT_EQUAL(HAL_OK, hal_battery_read(&read));
    TEST_ASSERT_EQUAL_UINT16(28, read);
    world_convert(0, 319);
    (void)hal_battery_read(&read);
    TEST_ASSERT_EQUAL_UINT16(8994, read);
}

static void test_port_buttons_count_once_however_they_bounce(void)
{
    world_press(KEY_RUN);
    world_run(250);
    (void)panel_pressed();
    world_press(0);
    world_run(250);
    TEST_ASSERT_EQUAL_UINT8(0, panel_pressed());
    for (uint8_t bounce = 0; bounce < 5; bounce++) {
        world_press(KEY_VIEW);
        world_run(2);
        world_press(0);
        world_run(1);
    }
    world_press(KEY_VIEW);
    TEST_ASSERT_EQUAL_UINT8(PANEL_VIEW, panel_pressed());
    world_run(300);
    TEST_ASSERT_EQUAL_UINT8(0, panel_pressed());
    world_press(KEY_VIEW | KEY_PRGM);
    world_run(250);
    TEST_ASSERT_EQUAL_UINT8(PANEL_PRGM, panel_pressed());
    world_press(KEY_RUN);
    world_run(250);
    TEST_ASSERT_EQUAL_UINT8(0, panel_pressed());
    world_press(0);
    world_run(250);
}

static void shows(const char *text)
{
    uint8_t shown[DISPLAY_SIZE];

    for (uint8_t i = 0; i < DISPLAY_SIZE; i++)
        shown[i] = display_memory[i];
    cputs((char *)text);
    TEST_ASSERT_EQUAL_MEMORY(display_memory, shown, DISPLAY_SIZE);
}

static void test_port_display_tells_mode_and_waypoint(void)
{
    mode_state_t mode = {.mode = MODE_IDLE};

    panel_show(&mode, true);
    shows("rESt");
    panel_show(&mode, false);
    shows("idLE");
    mode.mode = MODE_RUN;
    panel_show(&mode, false);
    shows("run 1");
    mode.los.waypoint = 11;
    panel_show(&mode, false);
    shows("run12");
    mode.mode = MODE_FAULT;
    mode.fault = MODE_STATE_LOST;
    panel_show(&mode, false);
    shows("Err 3");
    mode.fault = MODE_LATE; /* not the fault of Prgm, which is 4 */
    panel_show(&mode, false);
    shows("Err 7");
    mode.mode = MODE_ARRIVED;
    panel_show(&mode, false);
    shows("donE");
}

int world_main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_port_room_for_a_program);
    RUN_TEST(test_port_motors_are_symmetric_and_grow_with_duty);
    RUN_TEST(test_port_zero_duty_shorts_the_motors_and_pulses_float_between);
    RUN_TEST(test_port_gyro_reads_nothing_at_the_rails_and_mirrors_about_its_middle);
#ifndef RCX_ROTATION
    RUN_TEST(test_port_accelerometer_reads_nothing_at_the_rails_and_mirrors_about_its_middle);
#endif
#ifdef RCX_ROTATION
    RUN_TEST(test_port_rotation_counts_as_brickos_does);
#endif
    RUN_TEST(test_port_battery_follows_brickos_formula);
    RUN_TEST(test_port_buttons_count_once_however_they_bounce);
    RUN_TEST(test_port_display_tells_mode_and_waypoint);
    run_link_tests();
    return UNITY_END();
}
