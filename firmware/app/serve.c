#include "app/serve.h"

#include "core/bytes.h"
#include "hal.h"

void serve(commands_t *commands, loop_state_t *state)
{
    message_t message;

    while (hal_link_read(&message)) {
        const commands_result_t result = commands_take(commands, &state->step.mode, &message);
        if (result == COMMANDS_NOTHING)
            continue;
        if (result == COMMANDS_OPENED) {
            bytes_clear(state, sizeof *state);
            hal_motors_write(0, 0);
        }
        loop_heard(state);
        (void)hal_link_write(&message);
    }
}
