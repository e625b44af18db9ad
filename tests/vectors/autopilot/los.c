#include "autopilot/los.h"

#include "core/bytes.h"
#include "states.h"
#include "vectors.h"

enum { RUN_STEPS = 100 };

void vectors_feed(void)
{
    static los_config_t config;
    static route_t route;
    static route_waypoint_t waypoints[DRAWN_WAYPOINTS];
    static los_state_t state;
    static signals_estimate_t estimate;
    static signals_demand_t demand;
    static uint8_t left;

    if (left == 0) {
        left = RUN_STEPS;
        draw_los_config(&config);
        if (draw_rarely(2))
            bytes_copy_flash(&config, &PARAMS.step.mode.los, sizeof config);
        draw_route(&route, waypoints);
        bytes_clear(&state, sizeof state);
        bytes_clear(&demand, sizeof demand);
        draw_estimate(&estimate);
    }
    left--;
    if (draw_rarely(6))
        draw_estimate(&estimate);
    else
        draw_estimate_about(&estimate, &waypoints[state.waypoint], state.bearing_bam16);
    if (draw_rarely(6))
        los_reset(&state);
    estimate.period_ms = (uint8_t)draw_between(1, draw_rarely(3) ? 255 : 20);
    los_step(&config, &route, &state, &estimate, &demand);
    hash_demand(&demand);
    hash_los_state(&state);
}
