/* params_gen.h: generated from sim_host/models/rcx.toml by `python -m brickpilot.gen`.
 * Formats: see the structs' headers. A scale {mantissa, shift} is mantissa * 2^-(15 + shift), see model/scale.h. */
#ifndef BRICKPILOT_APP_PARAMS_GEN_H
#define BRICKPILOT_APP_PARAMS_GEN_H

#include "app/loop.h"

#ifndef BODY_WITHOUT_COUPLED
#if STEP_MS == 3
static const body_coefficients_t MODEL_COUPLED = {
    .profile = BODY_COUPLED,
    .motor = {
        {
            .current = {
                .from_current = {28920, 12},
                .from_speed = {-22638, 2},
                .from_voltage = {23117, 3},
            },
            .speed = {
                .from_current = {27814, 7},
                .from_speed = {-30759, 7},
                .from_voltage = {27792, 8},
            },
        },
        {
            .current = {
                .from_current = {16466, 10},
                .from_speed = {-22671, 2},
                .from_voltage = {23147, 3},
            },
            .speed = {
                .from_current = {21133, 7},
                .from_speed = {-23352, 7},
                .from_voltage = {21100, 8},
            },
        },
    },
    .drag = {26659, 9},
    .surge_from_wheel = {21391, 0},
    .quarter_wheel_from_surge = {25098, 1},
    .yaw_rate_from_wheel = {19099, 1},
    .travel_from_speed = {24576, 3},
    .heading_from_yaw_rate = {16406, 0},
};
static const loop_config_t PARAMS_COUPLED = {
    .step = {
        .model = &MODEL_COUPLED,
        .heading = {
            .quiet_mrad_s = 120,
            .rest_speed_mm_s_q4 = 80,
            .slowest_weight_bits = 4,
            .blind_ms = 100,
        },
        .speed = {
            .accel_gain_q15 = 6553,
            .slowest_weight_bits = 10,
            .count_travel_um_q2 = 21363,
            .behind_to_travel_q15 = 786,
            .behind_to_speed_q15 = 6442,
            .accel_filter_q15 = 4564,
        },
        .mode = {
            .los = {
                .acceptance_mm = 100,
                .bearing_hold_mm = 120,
                .cruise_mm_s_q4 = 6400,
                .creep_mm_s_q4 = 1280,
                .decel_mm_s2 = 400,
                .pivot_bam16 = 5215,
                .align_bam16 = 365,
                .rest_speed_mm_s_q4 = 320,
                .rest_ms = 30,
                .rest_yaw_rate_mrad_s = 300,
                .settle_ms = 30,
                .overshoot_mm = 150,
                .max_overshoots = 2,
                .skip_failed = true,
                .leg_timeout_ms = 20000,
            },
            .lost_ms = 150,
        },
        .speed_pid = {
            .kp_mv_q10 = 1280,
            .ki_mv_q10 = 1280,
            .kd_mv_q10 = 0,
            .limit_mv = 9000,
        },
        .heading_pid = {
            .kp_mv_q10 = 982,
            .ki_mv_q10 = 1963,
            .kd_mv_q10 = 2048,
            .limit_mv = 6000,
        },
        .feedforward_mv_q10 = 427,
        .mixer = {
            .battery_floor_mv = 5000,
            .max_duty_q15 = 32767,
        },
        .battery_nominal_mv = 9000,
    },
    .watchdog_ms = 20,
    .silent_ms = 100,
    .telemetry_every = 10,
};
#elif STEP_MS == 9
static const body_coefficients_t MODEL_COUPLED = {
    .profile = BODY_COUPLED,
    .motor = {
        {
            .current = {
                .from_current = {-19083, 9},
                .from_speed = {-22286, 2},
                .from_voltage = {22796, 3},
            },
            .speed = {
                .from_current = {27382, 7},
                .from_speed = {-25285, 5},
                .from_voltage = {23128, 6},
            },
        },
        {
            .current = {
                .from_current = {-29108, 10},
                .from_speed = {-22411, 2},
                .from_voltage = {22910, 3},
            },
            .speed = {
                .from_current = {20890, 7},
                .from_speed = {-19235, 5},
                .from_voltage = {17593, 6},
            },
        },
    },
    .drag = {19828, 7},
    .surge_from_wheel = {21391, 0},
    .quarter_wheel_from_surge = {25098, 1},
    .yaw_rate_from_wheel = {19099, 1},
};
static const loop_config_t PARAMS_COUPLED = {
    .step = {
        .model = &MODEL_COUPLED,
        .heading = {
            .quiet_mrad_s = 120,
            .rest_speed_mm_s_q4 = 80,
            .slowest_weight_bits = 4,
            .blind_ms = 100,
        },
        .speed = {
            .accel_gain_q15 = 6553,
            .slowest_weight_bits = 8,
            .count_travel_um_q2 = 21363,
            .behind_to_travel_q15 = 2359,
            .behind_to_speed_q15 = 19327,
            .accel_filter_q15 = 11874,
        },
        .mode = {
            .los = {
                .acceptance_mm = 100,
                .bearing_hold_mm = 120,
                .cruise_mm_s_q4 = 6400,
                .creep_mm_s_q4 = 1280,
                .decel_mm_s2 = 400,
                .pivot_bam16 = 5215,
                .align_bam16 = 365,
                .rest_speed_mm_s_q4 = 320,
                .rest_ms = 30,
                .rest_yaw_rate_mrad_s = 300,
                .settle_ms = 30,
                .overshoot_mm = 150,
                .max_overshoots = 2,
                .skip_failed = true,
                .leg_timeout_ms = 20000,
            },
            .lost_ms = 150,
        },
        .speed_pid = {
            .kp_mv_q10 = 1280,
            .ki_mv_q10 = 1280,
            .kd_mv_q10 = 0,
            .limit_mv = 9000,
        },
        .heading_pid = {
            .kp_mv_q10 = 982,
            .ki_mv_q10 = 1963,
            .kd_mv_q10 = 2048,
            .limit_mv = 6000,
        },
        .feedforward_mv_q10 = 427,
        .mixer = {
            .battery_floor_mv = 5000,
            .max_duty_q15 = 32767,
        },
        .battery_nominal_mv = 9000,
    },
    .watchdog_ms = 20,
    .silent_ms = 100,
    .telemetry_every = 10,
};
#else
#error "no constants of the coupled profile for this STEP_MS"
#endif
#endif

#ifndef BODY_WITHOUT_PAPER
#if STEP_MS == 3
static const body_coefficients_t MODEL_PAPER = {
    .profile = BODY_PAPER,
    .motor = {
        {
            .current = {
                .from_current = {-16798, 6},
                .from_speed = {-21623, 2},
                .from_voltage = {22202, 2},
            },
            .speed = {
                .from_current = {28197, 4},
                .from_speed = {-31963, 4},
                .from_voltage = {28893, 4},
            },
        },
        {
            .current = {
                .from_current = {-16798, 6},
                .from_speed = {-21623, 2},
                .from_voltage = {22202, 2},
            },
            .speed = {
                .from_current = {28197, 4},
                .from_speed = {-31963, 4},
                .from_voltage = {28893, 4},
            },
        },
    },
    .drag = {19791, 9},
    .thrust_from_voltage = {24368, 1},
    .thrust_from_wheel = {23903, 1},
    .yaw_rate_from_thrust = {21504, 8},
    .travel_from_speed = {24576, 3},
    .heading_from_yaw_rate = {16406, 0},
};
static const loop_config_t PARAMS_PAPER = {
    .step = {
        .model = &MODEL_PAPER,
        .heading = {
            .quiet_mrad_s = 120,
            .rest_speed_mm_s_q4 = 80,
            .slowest_weight_bits = 4,
            .blind_ms = 100,
        },
        .speed = {
            .accel_gain_q15 = 1638,
            .slowest_weight_bits = 10,
            .count_travel_um_q2 = 21363,
            .behind_to_travel_q15 = 0,
            .behind_to_speed_q15 = 0,
            .accel_filter_q15 = 4564,
        },
        .mode = {
            .los = {
                .acceptance_mm = 100,
                .bearing_hold_mm = 600,
                .cruise_mm_s_q4 = 16000,
                .creep_mm_s_q4 = 1600,
                .decel_mm_s2 = 350,
                .pivot_bam16 = 522,
                .align_bam16 = 63,
                .rest_speed_mm_s_q4 = 4,
                .rest_ms = 30,
                .rest_yaw_rate_mrad_s = 20,
                .settle_ms = 30,
                .overshoot_mm = 150,
                .max_overshoots = 2,
                .skip_failed = true,
                .leg_timeout_ms = 20000,
            },
            .lost_ms = 150,
        },
        .speed_pid = {
            .kp_mv_q10 = 25600,
            .ki_mv_q10 = 0,
            .kd_mv_q10 = 0,
            .limit_mv = 9000,
        },
        .heading_pid = {
            .kp_mv_q10 = 29452,
            .ki_mv_q10 = 0,
            .kd_mv_q10 = 31744,
            .limit_mv = 8000,
        },
        .feedforward_mv_q10 = 0,
        .mixer = {
            .battery_floor_mv = 5000,
            .max_duty_q15 = 32767,
        },
        .battery_nominal_mv = 9000,
    },
    .watchdog_ms = 20,
    .silent_ms = 100,
    .telemetry_every = 10,
};
#else
#error "no constants of the paper profile for this STEP_MS"
#endif
#endif

#endif
