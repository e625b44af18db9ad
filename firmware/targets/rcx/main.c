/* main.c: the autopilot as a program of brickOS. Run starts it: after two seconds at rest, which teach it the gyro's bias, it flies
 * the route below. A session over the infrared link, or Prgm, keeps it from that. View starts once more. Run again ends it. */
#include <unistd.h>

#include "app/serve.h"
#include "hal.h"
#include "rcx/infrared.h"
#include "rcx/sensors.h"
#include "targets/rcx/mission.h"
#include "targets/rcx/panel.h"

enum {
    REST_MS = 2000,
    RECORD_MS = 2000,   /* from one record of telemetry to the next: seven messages are half a second of the link */
    HEARTBEAT_MS = 3000 /* the same for HEARTBEAT and FAULTS */
};

static commands_t commands;
static loop_state_t state;
static bool starting; /* as soon as it has rested */

/* The clock, of which 16 bits are enough for what is timed here. */
static uint16_t now_ms, due_ms, resting_ms, record_ms, heartbeat_ms;

/* Where it is over, the time begins again. */
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

/* What the buttons say, or else the host. */
static mode_command_t command_now(void)
{
    mode_command_t command = commands_next(&commands);
    const uint8_t pressed = panel_pressed();
    const bool running = state.step.mode.mode == MODE_RUN;

    if (!state.started) /* a session has begun: the host starts */
        starting = false;
    if (pressed & PANEL_PRGM) {
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

/* The loop sends as often as its settings say, which is for faster links: held back here, tick by tick. */
static void hold_back(void)
{
    state.until_telemetry = state.until_heartbeat = 1;
    if (!infrared_idle())
        return;
    if (is_over(&record_ms, RECORD_MS))
        state.until_telemetry = 0;
    else if (is_over(&heartbeat_ms, HEARTBEAT_MS))
        state.until_heartbeat = 0;
}

/* Sleeps until the next tick is due, or lets the other tasks run where that is over. */
static void wait(void)
{
    const int16_t left_ms = (int16_t)(due_ms - (uint16_t)hal_clock_ms());

    due_ms = (uint16_t)(due_ms + STEP_MS);
    if (left_ms > 0) {
        (void)msleep((unsigned)left_ms);
    } else {
        due_ms = (uint16_t)(due_ms - left_ms);
        yield();
    }
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
        now_ms = (uint16_t)hal_clock_ms();
        serve(&commands, &state);
        hold_back();
        loop_tick(&commands.parameters.config, &commands.route, &state, command_now());
        panel_show(&state.step.mode, starting);
        wait();
    }
    hal_motors_write(0, 0);
    infrared_stop();
    return 0;
}
