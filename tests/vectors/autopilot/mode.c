#include "autopilot/mode.h"

#include "core/bytes.h"
#include "states.h"
#include "vectors.h"

enum { RUN_STEPS = 100 };

void vectors_feed(void)
{
    static mode_config_t config;
    static route_t route;
    static route_waypoint_t waypoints[DRAWN_WAYPOINTS];
    static mode_state_t state;
    static signals_estimate_t estimate;
    static signals_demand_t demand;
    static uint8_t left;
    mode_command_t command = MODE_NONE;

    if (left == 0) {
        left = RUN_STEPS;
        draw_los_config(&config.los);
        config.lost_ms = draw_up_to(draw_rarely(1) ? 65535U : 100);
        draw_route(&route, waypoints);
        if (draw_rarely(5))
            route.count = 0;
        bytes_clear(&state, sizeof state);
        draw_estimate(&estimate);
    }
    left--;
    if (state.mode != MODE_RUN)
        command = draw_rarely(1) ? MODE_START : MODE_RESET;
    if (draw_rarely(5))
        command = (mode_command_t)draw_up_to(MODE_CUT_LATE);
    draw_estimate_about(&estimate, &waypoints[state.los.waypoint], state.los.bearing_bam16);
    estimate.period_ms = (uint8_t)draw_between(1, draw_rarely(3) ? 255 : 20);
    mode_step(&config, &route, &state, &estimate, command, &demand);
    hash_mode_state(&state, &demand);
}
