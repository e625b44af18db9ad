#include "autopilot/mode.h"

/* With the motors off until guidance demands otherwise. */
static void enter(mode_state_t *state, mode_name_t mode, mode_fault_t fault)
{
    state->mode = mode;
    state->fault = fault;
    state->demand.drive = false;
    state->demand.speed_mm_s_q4 = 0;
}

/* Not a plain assignment: the RCX's compiler would call memcpy. */
static void take(signals_demand_t *demand, const signals_demand_t *guided)
{
    demand->drive = guided->drive;
    demand->speed_mm_s_q4 = guided->speed_mm_s_q4;
    demand->heading_bam16 = guided->heading_bam16;
}

static void follow(const mode_config_t *config, const route_t *route, mode_state_t *state,
                   const signals_state_t *signals, uint8_t period_ms)
{
    los_step(&config->los, route, &state->los, signals, period_ms, &state->guidance);
    state->lost_ms = 0;
    take(&state->demand, &state->guidance.demand);
    if (state->guidance.status == LOS_ARRIVED)
        enter(state, MODE_ARRIVED, MODE_NO_FAULT);
    else if (state->guidance.status == LOS_TIMED_OUT)
        enter(state, MODE_FAULT, MODE_LEG_TIMED_OUT);
    else if (state->guidance.status == LOS_OVERSHOT)
        enter(state, MODE_FAULT, MODE_LEG_OVERSHOT);
}

static void wait(const mode_config_t *config, mode_state_t *state, uint8_t period_ms)
{
    const uint32_t lost_ms = (uint32_t)state->lost_ms + period_ms;
    if (lost_ms > config->lost_ms)
        enter(state, MODE_FAULT, MODE_STATE_LOST);
    else
        state->lost_ms = (uint16_t)lost_ms;
}

static void start(const route_t *route, mode_state_t *state)
{
    los_reset(&state->los);
    state->lost_ms = 0;
    if (route->count == 0)
        enter(state, MODE_FAULT, MODE_NO_ROUTE);
    else
        enter(state, MODE_RUN, MODE_NO_FAULT);
}

void mode_step(const mode_config_t *config, const route_t *route, mode_state_t *state, const signals_state_t *signals,
               mode_command_t command, uint8_t period_ms)
{
    if (state->mode == MODE_IDLE && command == MODE_START)
        start(route, state);
    else if (state->mode == MODE_RUN && command == MODE_ABORT)
        enter(state, MODE_FAULT, MODE_COMMANDED);
    else if (state->mode == MODE_RUN && command == MODE_CUT)
        enter(state, MODE_FAULT, MODE_SILENT);
    else if (state->mode != MODE_RUN && command == MODE_RESET)
        enter(state, MODE_IDLE, MODE_NO_FAULT);

    if (state->mode != MODE_RUN)
        return;
    if (signals->valid)
        follow(config, route, state, signals, period_ms);
    else
        wait(config, state, period_ms);
}
