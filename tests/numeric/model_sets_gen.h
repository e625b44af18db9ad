/* model_sets_gen.h: generated from rcx.toml by `python -m brickpilot.gen`.
 * Vehicles in SI units, and the firmware's coefficients: nominal, then 6 up to 25% off. */
#ifndef BRICKPILOT_TESTS_MODEL_SETS_GEN_H
#define BRICKPILOT_TESTS_MODEL_SETS_GEN_H

#include "model/body.h"

enum { MODEL_SETS = 7, MODEL_SET_VALUES = 17 };

static const char *const MODEL_SET_NAME[MODEL_SET_VALUES] = {"mass", "yaw_inertia", "half_track", "wheel_radius", "wheel_inertia", "resistance", "inductance", "emf_constant", "torque_constant", "viscous_friction", "rolling_friction", "drag_area", "air_density", "gravity", "battery_voltage", "stall_torque", "no_load_speed"};

static const struct {
    double value[MODEL_SET_VALUES];
    body_coefficients_t coupled;
    body_coefficients_t paper;
} MODEL_SET[MODEL_SETS] = {
    {.value = {0.9, 0.006, 0.07, 0.0408, 0.0001, 22.0, 0.01, 0.245, 0.195, 1.8e-05, 0.015, 0.018, 1.2, 9.81, 9.0, 0.08, 36.7},
     .coupled = {
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
    },
     .paper = {
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
    }},
    {.value = {0.924685, 0.00471365, 0.0843881, 0.0371908, 0.000103089, 17.2552, 0.0087314, 0.238042, 0.164843, 1.85513e-05, 0.0170833, 0.0153049, 1.2, 9.81, 9.0, 0.08597912513329316, 37.80845397030776},
     .coupled = {
        .profile = BODY_COUPLED,
        .motor = {
            {
                .current = {
                    .from_current = {19280, 9},
                    .from_speed = {-27983, 2},
                    .from_voltage = {29412, 3},
                },
                .speed = {
                    .from_current = {29865, 7},
                    .from_speed = {-17941, 6},
                    .from_voltage = {16778, 7},
                },
            },
            {
                .current = {
                    .from_current = {22229, 10},
                    .from_speed = {-27920, 2},
                    .from_voltage = {29354, 3},
                },
                .speed = {
                    .from_current = {19727, 6},
                    .from_speed = {-23730, 6},
                    .from_voltage = {22192, 7},
                },
            },
        },
        .drag = {23614, 9},
        .surge_from_wheel = {19499, 0},
        .quarter_wheel_from_surge = {27534, 1},
        .yaw_rate_from_wheel = {28882, 2},
        .travel_from_speed = {24576, 3},
        .heading_from_yaw_rate = {16406, 0},
    },
     .paper = {
        .profile = BODY_PAPER,
        .motor = {
            {
                .current = {
                    .from_current = {-16515, 6},
                    .from_speed = {-26799, 2},
                    .from_voltage = {28309, 2},
                },
                .speed = {
                    .from_current = {25753, 4},
                    .from_speed = {-31673, 4},
                    .from_voltage = {29632, 4},
                },
            },
            {
                .current = {
                    .from_current = {-16515, 6},
                    .from_speed = {-26799, 2},
                    .from_voltage = {28309, 2},
                },
                .speed = {
                    .from_current = {25753, 4},
                    .from_speed = {-31673, 4},
                    .from_voltage = {29632, 4},
                },
            },
        },
        .drag = {32757, 10},
        .thrust_from_voltage = {27964, 1},
        .thrust_from_wheel = {26626, 1},
        .yaw_rate_from_thrust = {16952, 7},
        .travel_from_speed = {24576, 3},
        .heading_from_yaw_rate = {16406, 0},
    }},
    {.value = {0.817918, 0.0055969, 0.0624569, 0.0400673, 9.51649e-05, 25.3203, 0.00836672, 0.26391, 0.219924, 1.95465e-05, 0.0157179, 0.0152698, 1.2, 9.81, 9.0, 0.07817111171668582, 34.102534955098335},
     .coupled = {
        .profile = BODY_COUPLED,
        .motor = {
            {
                .current = {
                    .from_current = {-29715, 10},
                    .from_speed = {-21175, 2},
                    .from_voltage = {20075, 3},
                },
                .speed = {
                    .from_current = {25743, 7},
                    .from_speed = {-18861, 6},
                    .from_voltage = {32227, 8},
                },
            },
            {
                .current = {
                    .from_current = {-16450, 10},
                    .from_speed = {-21242, 2},
                    .from_voltage = {20132, 3},
                },
                .speed = {
                    .from_current = {31138, 8},
                    .from_speed = {-22775, 7},
                    .from_voltage = {19457, 8},
                },
            },
        },
        .drag = {25066, 9},
        .surge_from_wheel = {21007, 0},
        .quarter_wheel_from_surge = {25557, 1},
        .yaw_rate_from_wheel = {21021, 1},
        .travel_from_speed = {24576, 3},
        .heading_from_yaw_rate = {16406, 0},
    },
     .paper = {
        .profile = BODY_PAPER,
        .motor = {
            {
                .current = {
                    .from_current = {-31107, 7},
                    .from_speed = {-20041, 2},
                    .from_voltage = {19108, 2},
                },
                .speed = {
                    .from_current = {24057, 4},
                    .from_speed = {-18154, 3},
                    .from_voltage = {31030, 4},
                },
            },
            {
                .current = {
                    .from_current = {-31107, 7},
                    .from_speed = {-20041, 2},
                    .from_voltage = {19108, 2},
                },
                .speed = {
                    .from_current = {24057, 4},
                    .from_speed = {-18154, 3},
                    .from_voltage = {31030, 4},
                },
            },
        },
        .drag = {18474, 9},
        .thrust_from_voltage = {26679, 1},
        .thrust_from_wheel = {28164, 1},
        .yaw_rate_from_thrust = {18693, 8},
        .travel_from_speed = {24576, 3},
        .heading_from_yaw_rate = {16406, 0},
    }},
    {.value = {0.888813, 0.00613279, 0.066289, 0.0429524, 0.000101339, 26.4613, 0.0108758, 0.239743, 0.205172, 1.9098e-05, 0.0148561, 0.0218342, 1.2, 9.81, 9.0, 0.06978296606742676, 37.540199296746934},
     .coupled = {
        .profile = BODY_COUPLED,
        .motor = {
            {
                .current = {
                    .from_current = {-19473, 12},
                    .from_speed = {-18448, 2},
                    .from_voltage = {19251, 3},
                },
                .speed = {
                    .from_current = {24430, 7},
                    .from_speed = {-25378, 7},
                    .from_voltage = {22798, 8},
                },
            },
            {
                .current = {
                    .from_current = {17529, 12},
                    .from_speed = {-18480, 2},
                    .from_voltage = {19280, 3},
                },
                .speed = {
                    .from_current = {32467, 8},
                    .from_speed = {-16848, 7},
                    .from_voltage = {30270, 9},
                },
            },
        },
        .drag = {31395, 9},
        .surge_from_wheel = {22519, 0},
        .quarter_wheel_from_surge = {23840, 1},
        .yaw_rate_from_wheel = {21232, 1},
        .travel_from_speed = {24576, 3},
        .heading_from_yaw_rate = {16406, 0},
    },
     .paper = {
        .profile = BODY_PAPER,
        .motor = {
            {
                .current = {
                    .from_current = {-27420, 7},
                    .from_speed = {-17694, 2},
                    .from_voltage = {18576, 2},
                },
                .speed = {
                    .from_current = {26626, 4},
                    .from_speed = {-28283, 4},
                    .from_voltage = {25418, 4},
                },
            },
            {
                .current = {
                    .from_current = {-27420, 7},
                    .from_speed = {-17694, 2},
                    .from_voltage = {18576, 2},
                },
                .speed = {
                    .from_current = {26626, 4},
                    .from_speed = {-28283, 4},
                    .from_voltage = {25418, 4},
                },
            },
        },
        .drag = {24309, 9},
        .thrust_from_voltage = {20445, 1},
        .thrust_from_wheel = {19606, 1},
        .yaw_rate_from_thrust = {19675, 8},
        .travel_from_speed = {24576, 3},
        .heading_from_yaw_rate = {16406, 0},
    }},
    {.value = {0.882841, 0.00577962, 0.0864709, 0.0307784, 0.00012022, 24.2951, 0.00838441, 0.213748, 0.218698, 1.52352e-05, 0.0123442, 0.0165236, 1.2, 9.81, 9.0, 0.08101559573741207, 42.10565712895559},
     .coupled = {
        .profile = BODY_COUPLED,
        .motor = {
            {
                .current = {
                    .from_current = {-17689, 9},
                    .from_speed = {-17857, 2},
                    .from_voltage = {20897, 3},
                },
                .speed = {
                    .from_current = {18647, 6},
                    .from_speed = {-21174, 6},
                    .from_voltage = {23180, 7},
                },
            },
            {
                .current = {
                    .from_current = {-19865, 9},
                    .from_speed = {-17840, 2},
                    .from_voltage = {20879, 3},
                },
                .speed = {
                    .from_current = {20623, 6},
                    .from_speed = {-23429, 6},
                    .from_voltage = {25649, 7},
                },
            },
        },
        .drag = {29078, 9},
        .surge_from_wheel = {32273, 1},
        .quarter_wheel_from_surge = {16635, 0},
        .yaw_rate_from_wheel = {23327, 2},
        .travel_from_speed = {24576, 3},
        .heading_from_yaw_rate = {16406, 0},
    },
     .paper = {
        .profile = BODY_PAPER,
        .motor = {
            {
                .current = {
                    .from_current = {-21654, 7},
                    .from_speed = {-17314, 2},
                    .from_voltage = {20304, 2},
                },
                .speed = {
                    .from_current = {20242, 4},
                    .from_speed = {-23372, 4},
                    .from_voltage = {25589, 4},
                },
            },
            {
                .current = {
                    .from_current = {-21654, 7},
                    .from_speed = {-17314, 2},
                    .from_voltage = {20304, 2},
                },
                .speed = {
                    .from_current = {20242, 4},
                    .from_speed = {-23372, 4},
                    .from_voltage = {25589, 4},
                },
            },
        },
        .drag = {18521, 9},
        .thrust_from_voltage = {16674, 0},
        .thrust_from_wheel = {28512, 1},
        .yaw_rate_from_thrust = {27051, 8},
        .travel_from_speed = {24576, 3},
        .heading_from_yaw_rate = {16406, 0},
    }},
    {.value = {0.928099, 0.00603862, 0.0593192, 0.0437324, 0.000117795, 27.3507, 0.00796681, 0.19967, 0.229532, 1.4438e-05, 0.0183206, 0.0190199, 1.2, 9.81, 9.0, 0.07552962081409251, 45.07437271497972},
     .coupled = {
        .profile = BODY_COUPLED,
        .motor = {
            {
                .current = {
                    .from_current = {-30170, 11},
                    .from_speed = {-29754, 3},
                    .from_voltage = {18644, 3},
                },
                .speed = {
                    .from_current = {17764, 7},
                    .from_speed = {-23057, 7},
                    .from_voltage = {23656, 8},
                },
            },
            {
                .current = {
                    .from_current = {-32622, 12},
                    .from_speed = {-29817, 3},
                    .from_voltage = {18676, 3},
                },
                .speed = {
                    .from_current = {20350, 8},
                    .from_speed = {-26383, 8},
                    .from_voltage = {27069, 9},
                },
            },
        },
        .drag = {25521, 9},
        .surge_from_wheel = {22928, 0},
        .quarter_wheel_from_surge = {23415, 1},
        .yaw_rate_from_wheel = {24158, 1},
        .travel_from_speed = {24576, 3},
        .heading_from_yaw_rate = {16406, 0},
    },
     .paper = {
        .profile = BODY_PAPER,
        .motor = {
            {
                .current = {
                    .from_current = {-16597, 7},
                    .from_speed = {-28666, 3},
                    .from_voltage = {18087, 2},
                },
                .speed = {
                    .from_current = {18258, 4},
                    .from_speed = {-24166, 4},
                    .from_voltage = {24802, 4},
                },
            },
            {
                .current = {
                    .from_current = {-16597, 7},
                    .from_speed = {-28666, 3},
                    .from_voltage = {18087, 2},
                },
                .speed = {
                    .from_current = {18258, 4},
                    .from_speed = {-24166, 4},
                    .from_voltage = {24802, 4},
                },
            },
        },
        .drag = {20279, 9},
        .thrust_from_voltage = {20814, 1},
        .thrust_from_wheel = {16623, 1},
        .yaw_rate_from_thrust = {18672, 8},
        .travel_from_speed = {24576, 3},
        .heading_from_yaw_rate = {16406, 0},
    }},
    {.value = {0.677608, 0.00662762, 0.0687276, 0.0416365, 0.000101162, 25.2652, 0.0111781, 0.259849, 0.182614, 1.95989e-05, 0.0162455, 0.0188418, 1.2, 9.81, 9.0, 0.06505097921251365, 34.63549984798864},
     .coupled = {
        .profile = BODY_COUPLED,
        .motor = {
            {
                .current = {
                    .from_current = {-29229, 14},
                    .from_speed = {-20902, 2},
                    .from_voltage = {20125, 3},
                },
                .speed = {
                    .from_current = {31258, 7},
                    .from_speed = {-16474, 6},
                    .from_voltage = {28075, 8},
                },
            },
            {
                .current = {
                    .from_current = {17180, 10},
                    .from_speed = {-20967, 2},
                    .from_voltage = {20181, 3},
                },
                .speed = {
                    .from_current = {16388, 7},
                    .from_speed = {-17244, 7},
                    .from_voltage = {29388, 9},
                },
            },
        },
        .drag = {17556, 8},
        .surge_from_wheel = {21830, 0},
        .quarter_wheel_from_surge = {24594, 1},
        .yaw_rate_from_wheel = {19851, 1},
        .travel_from_speed = {24576, 3},
        .heading_from_yaw_rate = {16406, 0},
    },
     .paper = {
        .profile = BODY_PAPER,
        .motor = {
            {
                .current = {
                    .from_current = {-28171, 7},
                    .from_speed = {-20117, 2},
                    .from_voltage = {19458, 2},
                },
                .speed = {
                    .from_current = {25594, 4},
                    .from_speed = {-27539, 4},
                    .from_voltage = {23474, 4},
                },
            },
            {
                .current = {
                    .from_current = {-28171, 7},
                    .from_speed = {-20117, 2},
                    .from_voltage = {19458, 2},
                },
                .speed = {
                    .from_current = {25594, 4},
                    .from_speed = {-27539, 4},
                    .from_voltage = {23474, 4},
                },
            },
        },
        .drag = {27516, 9},
        .thrust_from_voltage = {25789, 1},
        .thrust_from_wheel = {26805, 1},
        .yaw_rate_from_thrust = {28781, 9},
        .travel_from_speed = {24576, 3},
        .heading_from_yaw_rate = {16406, 0},
    }},
};

#endif
