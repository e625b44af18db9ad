/* main.c: the autopilot on a board of your own. Copy this folder together with the port; CONTRIBUTING.md links the
 * recipe.
 *
 * The robot rests for two seconds to learn the gyro's bias. Then it flies the route of app/mission.h, unless a host
 * begins a session over the link.
 */
#include "app/mission.h"
#include "app/serve.h"
#include "hal.h"
#include "template/not_done.h"

enum { REST_TICKS = 2000 / STEP_MS };

static commands_t commands;
static loop_state_t state;
static uint16_t resting = REST_TICKS; /* ticks until the mission starts; 0: it does not start by itself */

/* Waits until the next tick is due, and returns true. Returns false to end the program. */
static bool wait_for_tick(void)
{
    NOT_DONE("start a timer of STEP_MS, sleep until it is over, and return true");
    return false;
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
    loop_start(&state);
    do {
        serve(&commands, &state);
        loop_tick(&commands.parameters.config, &commands.route, &state, command_now());
    } while (wait_for_tick());
    hal_motors_write(0, 0);
    return 0;
}
