/* Guidance on a kinematic unicycle: yaw rate follows the demand at once, speed within an acceleration limit. */
#ifndef BRICKPILOT_TEST_UNICYCLE_H
#define BRICKPILOT_TEST_UNICYCLE_H

#include "autopilot/los.h"
#include "core/fix.h"
#include "unity.h"

#include <math.h>

#define TURN 6.283185307179586
enum { PERIOD_MS = 3 };

static const los_config_t CONFIG = {
    .acceptance_mm = 100,
    .bearing_hold_mm = 150,
    .cruise_mm_s_q4 = 600 * 16,
    .creep_mm_s_q4 = 60 * 16,
    .decel_mm_s2 = 800,
    .pivot_bam16 = 5461, /* 30 degrees */
    .align_bam16 = 364,  /* 2 degrees */
    .rest_speed_mm_s_q4 = 10 * 16,
    .rest_ms = 60,
    .rest_yaw_rate_mrad_s = 100,
    .settle_ms = 60,
    .overshoot_mm = 150,
    .max_overshoots = 2,
    .skip_failed = false,
    .leg_timeout_ms = 20000,
};

/* The paper's mission, fig. 8. */
static const route_waypoint_t PAPER[] = {{1000, 1000}, {1000, -1000}, {0, -500},    {-1300, -700},
                                         {0, 200},     {-100, 1100},  {-300, 1500}, {1500, -1000}};

typedef struct {
    double x_mm, y_mm, heading, speed_mm_s, yaw_rate;
    double brake_mm_s2;
} unicycle_t;

static los_config_t config;
static route_t route;
static los_state_t state;
static signals_demand_t demand;
static unicycle_t robot;

/* The robot at the origin, at rest, pointing along x, with the paper's route before it. */
void setUp(void)
{
    config = CONFIG;
    robot = (unicycle_t){.brake_mm_s2 = 1500.0};
    state = (los_state_t){0};
    demand = (signals_demand_t){0};
    los_reset(&state);
    TEST_ASSERT_EQUAL(ROUTE_OK, route_set(&route, PAPER, 8));
}
void tearDown(void) {}

static inline uint16_t bam16(double radians)
{
    return (uint16_t)(int32_t)lround(remainder(radians, TURN) * 65536.0 / TURN);
}

static inline signals_estimate_t estimated(void)
{
    return (signals_estimate_t){.x_um = (int32_t)lround(robot.x_mm * 1000.0),
                                .y_um = (int32_t)lround(robot.y_mm * 1000.0),
                                .heading_bam16 = bam16(robot.heading),
                                .speed_mm_s_q4 = (int16_t)lround(robot.speed_mm_s * 16.0),
                                .yaw_rate_mrad_s = (int16_t)lround(robot.yaw_rate * 1000.0),
                                .period_ms = PERIOD_MS,
                                .valid = true};
}

static inline void drive(double period_s)
{
    const double wanted = state.phase != LOS_END ? demand.speed_mm_s_q4 / 16.0 : 0.0;
    const double change = wanted - robot.speed_mm_s;
    const double most = robot.brake_mm_s2 * period_s;
    robot.speed_mm_s += fmin(fmax(change, -most), most);
    const double error = fix_angle_diff_bam16(demand.heading_bam16, bam16(robot.heading)) * TURN / 65536.0;
    robot.yaw_rate = state.phase != LOS_END ? fmin(fmax(8.0 * error, -3.0), 3.0) : 0.0;
    robot.heading += robot.yaw_rate * period_s;
    robot.x_mm += robot.speed_mm_s * cos(robot.heading) * period_s;
    robot.y_mm += robot.speed_mm_s * sin(robot.heading) * period_s;
}

static inline void step(void)
{
    const signals_estimate_t estimate = estimated();
    los_step(&config, &route, &state, &estimate, &demand);
}

/* Moves on until `status` is other than underway or the time is over. */
static inline void run_ms(uint32_t duration_ms)
{
    for (uint32_t time = 0; time < duration_ms; time += PERIOD_MS) {
        step();
        if (state.status != LOS_UNDERWAY)
            return;
        drive(PERIOD_MS / 1000.0);
    }
}

/* One step with the robot put somewhere. */
static inline void step_at(double x_mm, double y_mm, double heading_degree)
{
    robot.x_mm = x_mm;
    robot.y_mm = y_mm;
    robot.heading = heading_degree * TURN / 360.0;
    step();
}

static inline void set_route(const route_waypoint_t *waypoints, uint8_t count)
{
    TEST_ASSERT_EQUAL(ROUTE_OK, route_set(&route, waypoints, count));
}

#endif
