/* The control loop for Frama-C's Eva: any readings, clocks, commands, routes and settings, for ever. */
#include <__fc_builtin.h>

#include "app/parameters.h"
#include "app/params_gen.h"
#include "app/settings_gen.h"
#include "hal.h"

#define ANY(object) Frama_C_make_unknown((char *)&(object), sizeof(object))

static hal_status_t any_status(void)
{
    return (hal_status_t)Frama_C_interval(HAL_OK, HAL_PARTLY);
}

uint32_t hal_clock_ms(void)
{
    uint32_t any;
    ANY(any);
    return any;
}

hal_status_t hal_imu_read(hal_imu_t *out)
{
    ANY(*out);
    return any_status();
}

hal_status_t hal_rotation_read(hal_rotation_t *out)
{
    ANY(*out);
    return any_status();
}

hal_status_t hal_reference_read(hal_reference_t *out)
{
    ANY(*out);
    return any_status();
}

hal_status_t hal_battery_read(uint16_t *out_mv)
{
    ANY(*out_mv);
    return any_status();
}

void hal_motors_write(int16_t left_q15, int16_t right_q15)
{
    (void)left_q15, (void)right_q15;
}

bool hal_link_write(const message_t *message)
{
    (void)message;
    return Frama_C_interval(0, 1);
}

#define EVA_LOW(low, span) low,
#define EVA_SPAN(low, span) span,
static const int16_t EVA_LOWS[] = {SETTINGS_RANGES(EVA_LOW)};
static const uint16_t EVA_SPANS[] = {SETTINGS_RANGES(EVA_SPAN)};

static int32_t any_setting(uint8_t range, uint8_t size)
{
    return size == 4 ? Frama_C_long_interval(1, 2147483647L)
                     : Frama_C_long_interval(EVA_LOWS[range], (int32_t)EVA_LOWS[range] + (int32_t)EVA_SPANS[range]);
}

#define EVA_SET(field, range, at_rest) parameters.field = any_setting(range, sizeof parameters.field);

static parameters_t parameters;
static route_waypoint_t waypoints[ROUTE_WAYPOINTS_MAX];
static loop_state_t state;

int main(void)
{
    route_t route = {waypoints, 0};

    parameters_start(&parameters, &PARAMS_COUPLED);
    parameters.config.step.model = &MODEL_COUPLED; /* Eva loses a pointer that is copied byte by byte */
    parameters.config.step.monitor = &MONITOR_COUPLED;
    loop_start(&state);
    for (;;) {
        if (Frama_C_interval(0, 1)) {
            SETTINGS(EVA_SET)
        }
        if (Frama_C_interval(0, 1)) {
            for (uint8_t i = 0; i < ROUTE_WAYPOINTS_MAX; i++) {
                waypoints[i].x_mm = (int16_t)Frama_C_interval(-30000, 30000);
                waypoints[i].y_mm = (int16_t)Frama_C_interval(-30000, 30000);
            }
            route.count = (uint8_t)Frama_C_interval(0, ROUTE_WAYPOINTS_MAX);
        }
        if (Frama_C_interval(0, 1))
            loop_heard(&state);
        loop_tick(&parameters.config, &route, &state, (mode_command_t)Frama_C_interval(MODE_NONE, MODE_CUT_LATE));
    }
}
