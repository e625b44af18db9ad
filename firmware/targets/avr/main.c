/* main.c: the autopilot on an ATmega328P or ATmega2560. After power-on, or a push of the reset button, the robot rests
 * for two seconds to learn the gyro's bias. Then it flies the route of app/mission.h. If a host begins a session on the
 * serial line, the host starts the mission instead. After any other reset, or a reset whose cause a boot loader hides,
 * the robot waits for a host (guard_may_start()).
 */
#include <avr/interrupt.h>

#include "app/mission.h"
#include "app/serve.h"
#include "avr/analogue.h"
#include "avr/board.h"
#include "avr/clock.h"
#include "avr/digital.h"
#include "avr/guard.h"
#include "avr/motors.h"
#include "avr/rotation.h"
#include "avr/serial.h"
#include "hal.h"

_Static_assert(STEP_MS == BOARD_TICK_MS, "a tick of the board is a control step");

enum { REST_TICKS = 2000 / STEP_MS };

static commands_t commands;
static loop_state_t state;
static uint16_t resting; /* ticks until the mission starts; 0: it does not start by itself */

static void start_devices(void)
{
    motors_start();
    clock_start();
    analogue_start();
    digital_start();
    rotation_start();
    serial_start();
    guard_start();
    sei();
}

/* Returns the host's command. When the rest is over, returns MODE_START instead. */
static mode_command_t command_now(void)
{
    const mode_command_t command = commands_next(&commands);

    if (command != MODE_NONE || !state.started) /* a session has begun: the host starts the mission */
        resting = 0;
    if (resting == 0 || --resting > 0)
        return command;
    return MODE_START;
}

int main(void)
{
    commands_start(&commands);
    (void)route_set(&commands.route, MISSION, sizeof MISSION / sizeof MISSION[0]);
    resting = guard_may_start() ? REST_TICKS : 0;
    start_devices();
    loop_start(&state);
    for (;;) {
        (void)clock_wait();
        guard_tick();
        serve(&commands, &state);
        loop_tick(&commands.parameters.config, &commands.route, &state, command_now());
    }
}
