#include <stddef.h>

#include "effects/vehicle.h"
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
