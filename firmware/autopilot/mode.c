#include "autopilot/mode.h"

#include "core/bytes.h"
#include "core/fix.h"

enum { WAIT_STEPS = 255 }; /* longest wait for the gyro's bias: 0.8 s with steps of 3 ms, 2.3 s with steps of 9 ms */

/* Enters a mode with the motors off. In RUN the same step may switch them on. */
static void enter(mode_state_t *state, mode_name_t mode, mode_fault_t fault)
{
    state->mode = mode;
    state->fault = fault;
    state->lost_ms = 0;
    state->waited_steps = 0;
    state->demand.drive = false;
    state->demand.speed_mm_s_q4 = 0;
}

static void obey(const route_t *route, mode_state_t *state, mode_command_t command)
{
    if (state->mode == MODE_RUN) {
        if (command == MODE_ABORT)
            enter(state, MODE_FAULT, MODE_COMMANDED);
        else if (command >= MODE_CUT_SILENT)
            enter(state, MODE_FAULT, (mode_fault_t)command);
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

/* True while a run waits at rest, before it drives, for the gyro's bias to be learnt. */
static bool waits_for_bias(mode_state_t *state, const signals_estimate_t *estimate)
{
    return estimate->bias_unknown && !state->demand.drive && state->waited_steps++ < WAIT_STEPS;
}

static void steer(const mode_config_t *config, const route_t *route, mode_state_t *state,
                  const signals_estimate_t *estimate)
{
    if (!estimate->valid) {
        state->lost_ms = fix_add_u16(state->lost_ms, estimate->period_ms);
        if (state->lost_ms > config->lost_ms)
            enter(state, MODE_FAULT, MODE_STATE_LOST);
        return;
    }
    state->lost_ms = 0;
    if (waits_for_bias(state, estimate))
        return;
    state->demand.drive = true;
    los_step(&config->los, route, &state->los, estimate, &state->demand);
    if (state->los.status == LOS_ARRIVED)
        enter(state, MODE_ARRIVED, MODE_NO_FAULT);
    else if (state->los.status == LOS_TIMED_OUT)
        enter(state, MODE_FAULT, MODE_LEG_TIMED_OUT);
    else if (state->los.status == LOS_OVERSHOT)
        enter(state, MODE_FAULT, MODE_LEG_OVERSHOT);
}

void mode_step(const mode_config_t *config, const route_t *route, mode_state_t *state,
               const signals_estimate_t *estimate, mode_command_t command, signals_demand_t *demand)
{
    obey(route, state, command);
    if (state->mode == MODE_RUN)
        steer(config, route, state, estimate);
    bytes_copy(demand, &state->demand, sizeof *demand);
}
