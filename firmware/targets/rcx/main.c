/* main.c: the autopilot as a program of brickOS. The button Run starts it. The robot rests for two seconds to learn the
 * gyro's bias, and then flies the route of mission.h. It does not fly if a session over the infrared link begins, or if
 * Prgm is pressed. View starts the mission again. Run ends the program.
 */
#include <unistd.h>

#include "app/mission.h"
#include "app/serve.h"
#include "hal.h"
#include "rcx/infrared.h"
#include "rcx/sensors.h"
#include "targets/rcx/panel.h"

enum {
    REST_MS = 2000,
    TELEMETRY_MS = 2000, /* period of a report: its seven messages occupy the link for half a second */
    HEARTBEAT_MS = 3000  /* period of the messages HEARTBEAT and FAULTS */
};

static commands_t commands;
static loop_state_t state;
static bool starting; /* the mission starts as soon as the robot has rested */

/* Clock times. 16 bits are enough for the times measured here. */
static uint16_t now_ms, due_ms, resting_ms, telemetry_ms, heartbeat_ms;

/* True if `time_ms` has passed since `since_ms`. In that case sets `since_ms` to now. */
static bool is_over(uint16_t *since_ms, uint16_t time_ms)
{
    if ((uint16_t)(now_ms - *since_ms) < time_ms)
        return false;
    *since_ms = now_ms;
    return true;
}

static void start_soon(void)
{
    starting = true;
    resting_ms = now_ms;
}

/* Returns the command of a button, or else the host's command. */
static mode_command_t command_now(void)
{
    mode_command_t command = commands_next(&commands);
    const uint8_t pressed = panel_pressed();
    const bool running = state.step.mode.mode == MODE_RUN;

    if (!state.started) /* a host has opened a session: it alone starts the mission */
        starting = false;
    if ((pressed & PANEL_PRGM) != 0) {
        starting = false;
        command = running ? MODE_ABORT : MODE_RESET;
    } else if ((pressed & PANEL_VIEW) && !running) {
        start_soon();
        command = MODE_RESET;
    } else if (starting && is_over(&resting_ms, REST_MS)) {
        starting = false;
        command = MODE_START;
    }
    return command;
}

/* The loop sends too often for this slow link. So this function delays the messages in every tick. */
static void hold_back(void)
{
    state.until_telemetry = state.until_heartbeat = 1;
    if (!infrared_idle())
        return;
    if (is_over(&telemetry_ms, TELEMETRY_MS))
        state.until_telemetry = 0;
    else if (is_over(&heartbeat_ms, HEARTBEAT_MS))
        state.until_heartbeat = 0;
}

/* Sleeps until the next tick is due. If the tick is due already, lets the other tasks run. */
static void wait(void)
{
    int16_t left_ms = (int16_t)(due_ms - (uint16_t)hal_clock_ms());

    if (left_ms < 0) {
        due_ms = (uint16_t)(due_ms - left_ms);
        left_ms = 0;
    }
    due_ms = (uint16_t)(due_ms + STEP_MS);
    (void)msleep((unsigned)left_ms);
}

int main(int argc, char **argv)
{
    (void)argc;
    (void)argv;
    commands_start(&commands);
    (void)route_set(&commands.route, MISSION, sizeof MISSION / sizeof MISSION[0]);
    sensors_start();
    loop_start(&state);
    if (!infrared_start())
        return 1;
    now_ms = due_ms = (uint16_t)hal_clock_ms();
    start_soon();
    while (!shutdown_requested()) {
        sensors_hold();
        now_ms = (uint16_t)hal_clock_ms();
        serve(&commands, &state);
        hold_back();
        loop_tick(&commands.parameters.config, &commands.route, &state, command_now());
        panel_show(&state.step.mode, starting);
        sensors_release();
        wait();
    }
    hal_motors_write(0, 0);
    infrared_stop();
    return 0;
}
