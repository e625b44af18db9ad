/* output.h: the outputs that follow from a state. */
#ifndef BRICKPILOT_PLANT_OUTPUT_H
#define BRICKPILOT_PLANT_OUTPUT_H

#include "plant/contact_load.h"

static inline void output_of_drive(const vehicle_t *vehicle, real_t *out)
{
    const state_t *state = &vehicle->state;
    const real_t radius = vehicle->parameter[PARAMETER_WHEEL_RADIUS];
    out[OUTPUT_ACCEL_SURGE] = vehicle->accel_surge;
    out[OUTPUT_ACCEL_SWAY] = vehicle->accel_sway;
    out[OUTPUT_YAW_RATE] = state->yaw_rate;
    out[OUTPUT_YAW_ANGLE] = state->heading;
    for (int k = 0; k < 2; k++) {
        out[OUTPUT_WHEEL_SPEED_LEFT + k] = state->wheel_speed[k];
        out[OUTPUT_WHEEL_ANGLE_LEFT + k] = state->wheel_angle[k];
        out[OUTPUT_WHEEL_TRAVEL_LEFT + k] = radius * state->wheel_angle[k];
        out[OUTPUT_WHEEL_VELOCITY_LEFT + k] = radius * state->wheel_speed[k];
        out[OUTPUT_CURRENT_LEFT + k] = state->current[k];
    }
    out[OUTPUT_X] = state->x;
    out[OUTPUT_Y] = state->y;
    out[OUTPUT_SURGE] = state->surge;
    out[OUTPUT_SWAY] = state->sway;
}

static inline void output_of_motor(const vehicle_t *vehicle, real_t *out)
{
    const state_t *state = &vehicle->state;
    const motor_t *motor = &vehicle->motor[0];
    const real_t lever = contact_load_lever(vehicle->parameter);
    const real_t volts = choose(is_nan(vehicle->voltage[0]), real_of(0), vehicle->voltage[0]);
    const real_t torque = motor->torque_constant * state->current[0] + motor->torque_per_volt * volts;
    const real_t absent = real_of(NAN);
    const mask_t turns = vehicle->parameter[PARAMETER_FORCE_PER_VOLT] <= 0, moves = lever > 0;
    out[OUTPUT_SPEED] = choose(turns, state->wheel_speed[0], absent);
    out[OUTPUT_ANGLE] = choose(turns, state->wheel_angle[0], absent);
    out[OUTPUT_CURRENT] = choose(motor->torque_per_volt <= 0, state->current[0], absent);
    out[OUTPUT_POSITION] = choose(moves, lever * state->wheel_angle[0], absent);
    out[OUTPUT_VELOCITY] = choose(moves, lever * state->wheel_speed[0], absent);
    out[OUTPUT_FORCE] = choose(moves, torque / lever, absent);
}

/* Writes the accelerometers' readings into `out`: means over all body steps since the last reading, as an integrating
 * converter gives them. Before this call `out` has the means over the last body step only. */
static inline void output_felt(const vehicle_t *vehicle, real_t *out)
{
    if (vehicle->vehicle == BP_MOTOR)
        return;
    out[OUTPUT_ACCEL_SURGE] = vehicle->felt[0];
    out[OUTPUT_ACCEL_SWAY] = vehicle->felt[1];
}

/* Fills OUTPUT_COUNT values from the state, without sensor effects. Outputs that this vehicle does not have are NaN. */
static inline void output_row(const vehicle_t *vehicle, real_t *out)
{
    for (int i = 0; i < OUTPUT_COUNT; i++)
        out[i] = real_of(NAN);
    out[OUTPUT_BATTERY_VOLTAGE] = vehicle->supply;
    if (vehicle->vehicle == BP_MOTOR)
        output_of_motor(vehicle, out);
    else
        output_of_drive(vehicle, out);
}

#endif
