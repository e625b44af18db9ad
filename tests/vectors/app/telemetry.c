#include "app/telemetry.h"

#include "states.h"
#include "vectors.h"

static void draw_pid(pid_output_t *pid)
{
    pid->proportional_mv = draw_s16();
    pid->integral_mv = draw_s16();
    pid->derivative_mv = draw_s16();
}

static void draw(step_state_t *state, step_output_t *output)
{
    draw_estimate(&output->estimate);
    draw_pid(&output->speed_pid);
    draw_pid(&output->heading_pid);
    output->effort.surge_mv = draw_s16();
    output->effort.yaw_mv = draw_s16();
    state->mode.mode = (mode_name_t)draw_up_to(MODE_FAULT);
    state->mode.fault = (mode_fault_t)draw_up_to(MODE_LATE);
    output->demand.speed_mm_s_q4 = draw_s16();
    output->demand.heading_bam16 = (uint16_t)draw_s16();
    state->mode.los.phase = (los_phase_t)draw_up_to(LOS_END);
    state->mode.los.waypoint = (uint8_t)draw_up_to(31);
    state->mode.los.cross_track_mm = draw_s16();
    state->mode.los.heading_error_bam16 = draw_s16();
    state->mode.los.overshoots = draw_up_to(65535U);
    output->drive.surge_saturated = (int8_t)draw_between(-1, 1);
    output->drive.yaw_saturated = (int8_t)draw_between(-1, 1);
    state->mixer.battery_mv = draw_up_to(32000);
}

static void hash(const message_t *message)
{
    hash_u16(message->id);
    hash_u8(message->size);
    for (uint8_t i = 0; i < message->size; i++)
        hash_u8(message->data[i]);
}

void vectors_feed(void)
{
    static loop_state_t state;
    message_t message;

    draw(&state.step, &state.output);
    state.clock_ms = (uint32_t)draw_s32();
    state.tick = (uint32_t)draw_s32();
    state.late_ticks = draw_up_to(65535U);
    state.aborted = draw_up_to(draw_rarely(3) ? 65535U : 300);
    for (telemetry_part_t part = 0; part < TELEMETRY_PARTS; part++) {
        telemetry_part(part, &state, &message);
        hash(&message);
    }
    telemetry_heartbeat(&state, &message);
    hash(&message);
#ifndef MONITOR_OFF
    for (uint8_t channel = 0; channel < MONITOR_CHANNELS; channel++) {
        monitor_report_t *const report = &state.step.monitor.report[channel];
        report->since_ms = (uint32_t)draw_s32();
        report->size = draw_s16();
        report->cause = (uint8_t)draw_up_to(MONITOR_SLIP);
        telemetry_monitor(channel, &state, &message);
        hash(&message);
    }
#endif
}
