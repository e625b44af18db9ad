/* controllers_gen.h: generated from rcx.toml by `python -m brickpilot.gen`. SI units. */
#ifndef BRICKPILOT_TESTS_CONTROLLERS_GEN_H
#define BRICKPILOT_TESTS_CONTROLLERS_GEN_H

#include "double_controller.h"

static const double_constants_t CONTROLLER_COUPLED = {
    .acceptance = 0.1,
    .cruise = 0.4,
    .creep = 0.08,
    .decel = 0.4,
    .speed_kp = 20.0,
    .speed_ki = 20.0,
    .speed_kd = 0.0,
    .speed_limit = 9.0,
    .feedforward_share = 1.0,
    .heading_kp = 10.0,
    .heading_ki = 20.0,
    .heading_kd = 2.0,
    .heading_limit = 6.0,
    .bearing_hold = 0.12,
    .pivot = 0.5,
    .align = 0.035,
    .rest_speed = 0.02,
    .rest_time = 0.03,
    .rest_yaw_rate = 0.3,
    .settle_time = 0.03,
    .overshoot = 0.15,
    .max_overshoots = 2.0,
    .skip_failed = 1.0,
    .leg_timeout = 20.0,
    .battery_floor = 5.0,
    .max_duty = 1.0,
    .accel_filter_time = 0.02,
};

static const double_constants_t CONTROLLER_PAPER = {
    .acceptance = 0.1,
    .cruise = 1.0,
    .creep = 0.1,
    .decel = 0.35,
    .speed_kp = 400.0,
    .speed_ki = 0.0,
    .speed_kd = 0.0,
    .speed_limit = 9.0,
    .feedforward_share = 0.0,
    .heading_kp = 300.0,
    .heading_ki = 0.0,
    .heading_kd = 31.0,
    .heading_limit = 8.0,
    .bearing_hold = 0.6,
    .pivot = 0.05,
    .align = 0.006,
    .rest_speed = 0.00025,
    .rest_time = 0.03,
    .rest_yaw_rate = 0.02,
    .settle_time = 0.03,
    .overshoot = 0.15,
    .max_overshoots = 2.0,
    .skip_failed = 1.0,
    .leg_timeout = 20.0,
    .battery_floor = 5.0,
    .max_duty = 1.0,
    .accel_filter_time = 0.02,
};

#endif
