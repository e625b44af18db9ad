#include "app/serve.h"

#include "hal.h"

void serve(commands_t *commands, loop_state_t *state)
{
    message_t message;

    if (!hal_link_read(&message) || !commands_take(commands, state, &message))
        return;
    if (!state->started) /* a new session */
        hal_motors_write(0, 0);
    loop_heard(state);
    (void)hal_link_write(&message);
}
