#include "autopilot/mode.h"

#include "core/fix.h"

/* With the motors off until guidance demands otherwise. */
static void enter(mode_state_t *state, mode_name_t mode, mode_fault_t fault)
{
    state->mode = mode;
    state->fault = fault;
    state->lost_ms = 0;
    state->los.demand.drive = false;
    state->los.demand.speed_mm_s_q4 = 0;
}

static void obey(const route_t *route, mode_state_t *state, mode_command_t command)
{
    if (state->mode == MODE_RUN) {
        if (command == MODE_ABORT)
            enter(state, MODE_FAULT, MODE_COMMANDED);
        else if (command == MODE_CUT)
            enter(state, MODE_FAULT, MODE_SILENT);
    } else if (command == MODE_RESET) {
        enter(state, MODE_IDLE, MODE_NO_FAULT);
    } else if (state->mode == MODE_IDLE && command == MODE_START) {
        los_reset(&state->los);
        if (route->count == 0)
            enter(state, MODE_FAULT, MODE_NO_ROUTE);
        else
            enter(state, MODE_RUN, MODE_NO_FAULT);
    }
}

void mode_step(const mode_config_t *config, const route_t *route, mode_state_t *state, const signals_state_t *signals,
               mode_command_t command)
{
    obey(route, state, command);
    if (state->mode != MODE_RUN)
        return;
    if (!signals->valid) {
        state->lost_ms = fix_add_u16(state->lost_ms, signals->sensors.period_ms);
        if (state->lost_ms > config->lost_ms)
            enter(state, MODE_FAULT, MODE_STATE_LOST);
        return;
    }
    state->lost_ms = 0;
    state->los.demand.drive = true;
    los_step(&config->los, route, &state->los, signals);
    if (state->los.status == LOS_ARRIVED)
        enter(state, MODE_ARRIVED, MODE_NO_FAULT);
    else if (state->los.status != LOS_UNDERWAY) /* the faults of a leg follow each other as guidance's do */
        enter(state, MODE_FAULT, (mode_fault_t)(state->los.status - LOS_TIMED_OUT + MODE_LEG_TIMED_OUT));
}
