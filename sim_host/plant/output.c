#include "plant/output.h"

#include <math.h>
#include <stddef.h>

#include "plant/contact.h"

typedef struct {
    const char *name;
    const char *unit;
} column_t;

static const column_t COLUMN[OUTPUT_COUNT] = {
    [OUTPUT_ACCEL_SURGE] = {"accel_surge", "m/s^2"},
    [OUTPUT_ACCEL_SWAY] = {"accel_sway", "m/s^2"},
    [OUTPUT_YAW_RATE] = {"yaw_rate", "rad/s"},
    [OUTPUT_YAW_ANGLE] = {"yaw_angle", "rad"},
    [OUTPUT_WHEEL_SPEED_LEFT] = {"wheel_speed_left", "rad/s"},
    [OUTPUT_WHEEL_SPEED_RIGHT] = {"wheel_speed_right", "rad/s"},
    [OUTPUT_WHEEL_ANGLE_LEFT] = {"wheel_angle_left", "rad"},
    [OUTPUT_WHEEL_ANGLE_RIGHT] = {"wheel_angle_right", "rad"},
    [OUTPUT_WHEEL_TRAVEL_LEFT] = {"wheel_travel_left", "m"},
    [OUTPUT_WHEEL_TRAVEL_RIGHT] = {"wheel_travel_right", "m"},
    [OUTPUT_WHEEL_VELOCITY_LEFT] = {"wheel_velocity_left", "m/s"},
    [OUTPUT_WHEEL_VELOCITY_RIGHT] = {"wheel_velocity_right", "m/s"},
    [OUTPUT_CURRENT_LEFT] = {"current_left", "A"},
    [OUTPUT_CURRENT_RIGHT] = {"current_right", "A"},
    [OUTPUT_BATTERY_VOLTAGE] = {"battery_voltage", "V"},
    [OUTPUT_SPEED] = {"speed", "rad/s"},
    [OUTPUT_ANGLE] = {"angle", "rad"},
    [OUTPUT_POSITION] = {"position", "m"},
    [OUTPUT_VELOCITY] = {"velocity", "m/s"},
    [OUTPUT_CURRENT] = {"current", "A"},
    [OUTPUT_FORCE] = {"force", "N"},
    [OUTPUT_X] = {"x", "m"},
    [OUTPUT_Y] = {"y", "m"},
    [OUTPUT_SURGE] = {"surge", "m/s"},
    [OUTPUT_SWAY] = {"sway", "m/s"},
};

const char *bp_output_name(int index)
{
    return index < 0 || index >= OUTPUT_COUNT ? NULL : COLUMN[index].name;
}

const char *bp_output_unit(int index)
{
    return index < 0 || index >= OUTPUT_COUNT ? NULL : COLUMN[index].unit;
}

static void diff_drive_row(const vehicle_t *vehicle, double *out)
{
    const bp_state *state = &vehicle->state;
    const double radius = vehicle->parameter[PARAMETER_WHEEL_RADIUS];
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

static void motor_row(const vehicle_t *vehicle, double *out)
{
    const bp_state *state = &vehicle->state;
    const motor_t *motor = &vehicle->motor[0];
    const double lever = contact_load_lever(vehicle->parameter);
    const double volts = isnan(vehicle->voltage[0]) ? 0 : vehicle->voltage[0];
    const double torque = motor->torque_constant * state->current[0] + motor->torque_per_volt * volts;
    if (vehicle->parameter[PARAMETER_FORCE_PER_VOLT] <= 0) {
        out[OUTPUT_SPEED] = state->wheel_speed[0];
        out[OUTPUT_ANGLE] = state->wheel_angle[0];
    }
    if (motor->torque_per_volt <= 0)
        out[OUTPUT_CURRENT] = state->current[0];
    if (lever > 0) {
        out[OUTPUT_POSITION] = lever * state->wheel_angle[0];
        out[OUTPUT_VELOCITY] = lever * state->wheel_speed[0];
        out[OUTPUT_FORCE] = torque / lever;
    }
}

void output_row(const vehicle_t *vehicle, double *out)
{
    for (int i = 0; i < OUTPUT_COUNT; i++)
        out[i] = NAN;
    out[OUTPUT_BATTERY_VOLTAGE] = vehicle->supply;
    if (vehicle->vehicle == BP_MOTOR)
        motor_row(vehicle, out);
    else
        diff_drive_row(vehicle, out);
}
