#include "contracts.h"
#include "app/loop.c"
#include "app/telemetry.c"

static int16_t left, right;
static uint8_t writes;

uint32_t hal_clock_ms(void)
{
    uint32_t any;
    return any;
}
hal_status_t hal_imu_read(hal_imu_t *out)
{
    hal_status_t any;
    hal_imu_t read;
    *out = read;
    return any;
}
hal_status_t hal_rotation_read(hal_rotation_t *out)
{
    hal_status_t any;
    hal_rotation_t read;
    *out = read;
    return any;
}
hal_status_t hal_reference_read(hal_reference_t *out)
{
    hal_status_t any;
    hal_reference_t read;
    *out = read;
    return any;
}
hal_status_t hal_battery_read(uint16_t *out_mv)
{
    hal_status_t any;
    uint16_t read;
    *out_mv = read;
    return any;
}
void hal_motors_write(int16_t left_q15, int16_t right_q15)
{
    left = left_q15;
    right = right_q15;
    writes++;
}
bool hal_link_write(const message_t *message)
{
    bool any;
    ASSERT(message->id <= MESSAGE_ID_MAX && message->size <= MESSAGE_DATA_MAX);
    return any;
}

void step_run(const step_config_t *config, const route_t *route, step_state_t *state, const signals_sensors_t *sensors,
              mode_command_t command, step_output_t *output) /* step.c */
{
    step_state_t after;
    step_output_t any;
    (void)config, (void)route;
    ASSERT(sensors_hold(sensors));
    ASSUME(after.mode.mode <= MODE_FAULT && drive_holds(&any.drive));
    ASSUME(after.mode.mode == MODE_RUN || (any.drive.left_q15 == 0 && any.drive.right_q15 == 0));
    ASSUME(state->mode.mode != MODE_RUN || command < MODE_CUT_SILENT ||
           after.mode.mode == MODE_FAULT); /* mode.c: obey() */
    *state = after;
    *output = any;
}

void loop_tick_safe(void)
{
    parameters_t parameters;
    route_t route;
    loop_state_t state;
    mode_command_t command;

    ASSUME(settings_hold(&parameters) && state.next_part <= TELEMETRY_PARTS && state.next_channel < MONITOR_CHANNELS);
    const bool ran = state.step.mode.mode == MODE_RUN;
    loop_tick(&parameters.config, &route, &state, command);
    ASSERT(sensors_hold(&state.sensors) && state.next_part <= TELEMETRY_PARTS && state.next_channel < MONITOR_CHANNELS);
    ASSERT(writes == 1 && (state.step.mode.mode == MODE_RUN || (left == 0 && right == 0)));
    ASSERT(!ran || state.silent_ms <= parameters.config.silent_ms || state.step.mode.mode == MODE_FAULT);
    END();
}
