/* main.c: the autopilot as a program of brickOS. Run starts it: after two seconds at rest, which teach it the gyro's bias, it flies
 * the route below. A session over the infrared link, or Prgm, keeps it from that. View starts once more. Run again ends it. */
#include <unistd.h>

#include "app/serve.h"
#include "hal.h"
#include "rcx/infrared.h"
#include "rcx/panel.h"
#include "rcx/sensors.h"

enum {
    REST_MS = 2000,
    RECORD_MS = 2000,   /* from one record of telemetry to the next: seven messages are half a second of the link */
    HEARTBEAT_MS = 3000 /* the same for HEARTBEAT and FAULTS */
};

/* The paper's fig. 8, mm. */
static const route_waypoint_t MISSION[] = {{1000, 1000}, {1000, -1000}, {0, -500},    {-1300, -700},
                                           {0, 200},     {-100, 1100},  {-300, 1500}, {1500, -1000}};
enum { MISSION_COUNT = sizeof MISSION / sizeof MISSION[0] };

static commands_t commands;
static loop_state_t state;
static bool starting; /* as soon as it has rested */
static uint32_t resting_ms, record_ms, heartbeat_ms;

static void load_mission(void)
{
    for (uint8_t i = 0; i < MISSION_COUNT; i++)
        commands.waypoints[i] = MISSION[i];
    (void)route_set(&commands.route, commands.waypoints, MISSION_COUNT);
}

static void start_soon(uint32_t now_ms)
{
    starting = true;
    resting_ms = now_ms;
}

/* What the buttons say, or else the host. */
static mode_command_t command_for(uint32_t now_ms)
{
    const mode_command_t command = commands_next(&commands);
    const uint8_t pressed = panel_pressed();
    const bool running = state.step.mode.mode == MODE_RUN;

    if (!state.started) /* a session has begun: the host starts */
        starting = false;
    if (pressed & PANEL_PRGM) {
        starting = false;
        return running ? MODE_ABORT : MODE_RESET;
    }
    if ((pressed & PANEL_VIEW) && !running) {
        start_soon(now_ms);
        return MODE_RESET;
    }
    if (starting && now_ms - resting_ms >= REST_MS) {
        starting = false;
        return MODE_START;
    }
    return command;
}

/* The loop sends as often as its settings say, which is for faster links: held back here, tick by tick. */
static void hold_back(uint32_t now_ms)
{
    const bool idle = infrared_idle();
    const bool record = idle && now_ms - record_ms >= RECORD_MS;
    const bool heartbeat = idle && !record && now_ms - heartbeat_ms >= HEARTBEAT_MS;

    state.until_telemetry = record ? 0 : 1;
    state.until_heartbeat = heartbeat ? 0 : 1;
    if (record)
        record_ms = now_ms;
    if (heartbeat)
        heartbeat_ms = now_ms;
}

/* Sleeps until `due_ms`, or lets the other tasks run where that is over. Returns when the next tick is due. */
static uint32_t wait_until(uint32_t due_ms)
{
    const uint32_t now_ms = hal_clock_ms();
    const int32_t left_ms = (int32_t)(due_ms - now_ms);

    if (left_ms > 0) {
        (void)msleep((unsigned)left_ms);
        return due_ms + STEP_MS;
    }
    yield();
    return now_ms + STEP_MS;
}

int main(int argc, char **argv)
{
    uint32_t due_ms;

    (void)argc;
    (void)argv;
    commands_start(&commands);
    load_mission();
    sensors_start();
    loop_start(&state);
    if (!infrared_start())
        return 1;
    due_ms = hal_clock_ms();
    start_soon(due_ms);
    while (!shutdown_requested()) {
        const uint32_t now_ms = hal_clock_ms();
        mode_command_t command;

        serve(&commands, &state);
        command = command_for(now_ms);
        hold_back(now_ms);
        loop_tick(&commands.parameters.config, &commands.route, &state, command);
        panel_show(&state.step.mode, starting);
        due_ms = wait_until(due_ms);
    }
    hal_motors_write(0, 0);
    infrared_stop();
    return 0;
}
