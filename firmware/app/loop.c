#include "app/loop.h"

#include "app/telemetry.h"
#include "core/fix.h"
#include "hal.h"

enum { LONGEST_MS = 20, HEARTBEAT_TICKS = 100, MONITOR_TICK = 9 };

static void read_sensors(loop_state_t *state)
{
    hal_imu_t imu;
    hal_rotation_t rotation;
    hal_reference_t reference;
    const hal_status_t imu_status = hal_imu_read(&imu);
    uint8_t have = 0;

    if (imu_status == HAL_OK || imu_status == HAL_PARTLY) {
        have |= SENSOR_GYRO;
        state->sensors.yaw_rate_mrad_s = imu.yaw_rate_mrad_s;
    }
    if (SENSOR_POSSIBLE(SENSOR_ACCELEROMETER) && imu_status == HAL_OK) {
        have |= SENSOR_ACCELEROMETER;
        state->sensors.accel_surge_mm_s2 = imu.accel_surge_mm_s2;
        state->sensors.accel_sway_mm_s2 = imu.accel_sway_mm_s2;
    }
    if (SENSOR_POSSIBLE(SENSOR_ROTATION) && hal_rotation_read(&rotation) == HAL_OK) {
        have |= SENSOR_ROTATION;
        state->sensors.rotation_left = rotation.left;
        state->sensors.rotation_right = rotation.right;
    }
    if (SENSOR_POSSIBLE(SENSOR_REFERENCE) && hal_reference_read(&reference) == HAL_OK) {
        have |= SENSOR_REFERENCE;
        state->sensors.reference_x_um = reference.x_um;
        state->sensors.reference_y_um = reference.y_um;
        state->sensors.reference_heading_bam16 = reference.heading_bam16;
        state->sensors.reference_speed_mm_s_q4 = reference.speed_mm_s_q4;
        state->sensors.reference_yaw_rate_mrad_s = reference.yaw_rate_mrad_s;
    }
    if (SENSOR_POSSIBLE(SENSOR_BATTERY) && hal_battery_read(&state->sensors.battery_mv) == HAL_OK)
        have |= SENSOR_BATTERY;
    state->sensors.have = have;
}

static void send_telemetry(const loop_config_t *config, loop_state_t *state)
{
    const uint8_t every = config->telemetry_every;
    message_t message;

    if (every == 0)
        return;
    if (state->until_telemetry > 0) {
        state->until_telemetry--;
    } else {
        state->until_telemetry = (uint8_t)(every - 1);
        state->next_part = 0;
    }
    /* If `every` is small, a tick sends several parts, so that one report ends before the next report begins. */
    for (uint8_t sent = 0; sent < TELEMETRY_PARTS; sent = (uint8_t)(sent + every)) {
        if (state->next_part == TELEMETRY_PARTS)
            return;
        telemetry_part(state->next_part++, state, &message);
        (void)hal_link_write(&message);
    }
}

static void send_heartbeat(loop_state_t *state)
{
    message_t message;

    if (state->until_heartbeat > 0) {
        state->until_heartbeat--;
        return;
    }
    state->until_heartbeat = HEARTBEAT_TICKS - 1;
    telemetry_heartbeat(state, &message);
    (void)hal_link_write(&message);
}

#ifndef MONITOR_OFF
/* Reports a channel of the monitor once between two heartbeats, in a tick in which the telemetry pauses by default. */
static void send_monitor(loop_state_t *state)
{
    message_t message;

    if (state->until_heartbeat != HEARTBEAT_TICKS - MONITOR_TICK)
        return;
    telemetry_monitor(state->next_channel, state, &message);
    (void)hal_link_write(&message);
    state->next_channel = state->next_channel < MONITOR_CHANNELS - 1 ? (uint8_t)(state->next_channel + 1) : (uint8_t)0;
}
#endif

static void take_time(loop_state_t *state)
{
    state->clock_ms = hal_clock_ms() - STEP_MS;
    state->started = true;
}

/* Returns the time since the previous tick, at most 65535 ms. */
static uint16_t elapse(loop_state_t *state)
{
    const uint32_t now_ms = hal_clock_ms(), elapsed_ms = now_ms - state->clock_ms;
    state->clock_ms = now_ms;
    return elapsed_ms > 65535U ? (uint16_t)65535U : (uint16_t)elapsed_ms;
}

static uint8_t period_ms(uint16_t elapsed_ms)
{
    if (elapsed_ms < 1)
        return 1;
    return elapsed_ms > LONGEST_MS ? (uint8_t)LONGEST_MS : (uint8_t)elapsed_ms;
}

void loop_start(loop_state_t *state)
{
    take_time(state);
    hal_motors_write(0, 0);
}

void loop_heard(loop_state_t *state)
{
    state->silent_ms = 0;
}

/* Returns `command`. Returns the command that cuts the run if a tick is too late or the silence has lasted too long. */
static mode_command_t guard(const loop_config_t *config, loop_state_t *state, uint16_t elapsed_ms,
                            mode_command_t command)
{
    state->silent_ms = state->sensors.have != 0 ? 0 : fix_add_u16(state->silent_ms, elapsed_ms);
    if (state->step.mode.mode != MODE_RUN)
        return command;
    if (state->silent_ms > config->silent_ms)
        command = MODE_CUT_SILENT;
    else if (elapsed_ms > config->watchdog_ms || elapsed_ms > LONGEST_MS)
        command = MODE_CUT_LATE;
    else
        return command;
    state->aborted = fix_increment_u16(state->aborted);
    return command;
}

void loop_tick(const loop_config_t *config, const route_t *route, loop_state_t *state, mode_command_t command)
{
    uint16_t elapsed_ms;

    if (!state->started)
        take_time(state);
    elapsed_ms = elapse(state);
    if (elapsed_ms >= 2 * STEP_MS)
        state->late_ticks = fix_increment_u16(state->late_ticks);
    state->sensors.period_ms = period_ms(elapsed_ms);
    read_sensors(state);
    command = guard(config, state, elapsed_ms, command);
    step_run(&config->step, route, &state->step, &state->sensors, command, &state->output);
    hal_motors_write(state->output.drive.left_q15, state->output.drive.right_q15);
    send_telemetry(config, state);
    send_heartbeat(state);
#ifndef MONITOR_OFF
    send_monitor(state);
#endif
    state->tick++;
}
