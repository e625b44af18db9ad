/* brickpilot_sim.h: the plant's C interface. Python (cffi) and others call this and nothing else.
 *
 * A model is one vehicle: nominal parameters and the effects switched on. It is not written while runs use it, so
 * many runs, on many threads, may share one. SI units throughout; frame of the paper (x forward, y right, clockwise
 * positive). Functions that return int give 0 or a BP_E_ code. This header is read by cffi as it stands: plain
 * declarations only.
 */
#ifndef BRICKPILOT_SIM_H
#define BRICKPILOT_SIM_H

enum { BP_DIFF_DRIVE = 0, BP_MOTOR = 1 }; /* vehicle */
enum { BP_COUPLED = 0, BP_PAPER = 1 };    /* profile */
enum { BP_E_NAME = -1, BP_E_RANGE = -2, BP_E_MEMORY = -3, BP_E_TIME = -4, BP_E_DIVERGED = -5 };
enum { BP_MAX_PARAMETERS = 160 }; /* of one effect */

typedef struct bp_model bp_model;

typedef struct {
    const char *name;
    const char *unit; /* SI, "1" where there is none */
    const char *meaning;
    double minimum; /* allowed range, ends included */
    double maximum;
    double preset; /* value when nobody says otherwise; for an effect: a clearly visible size */
    int odd;       /* effects: 1 where the sign turns over when left and right are swapped */
} bp_parameter_info;

typedef struct {
    const char *name;
    const char *acts_on; /* supply, drive, motor, gear, wheel, body, sensor or timing */
    const char *equation;
    const char *source;
    int parameter_count;
    const bp_parameter_info *parameters;
} bp_effect_info;

/* The tables: nominal parameters, effects, and output columns. NULL beyond the last. */
const bp_parameter_info *bp_parameter(int index);
const bp_effect_info *bp_effect(int index);
const char *
bp_output_name(int index); /* as in data sets: "yaw_rate", "wheel_speed_left", ...; then "x", "y", "surge", "sway" */
const char *bp_output_unit(int index);

bp_model *bp_model_new(int vehicle, int profile); /* presets, no effect on; a BP_MOTOR has no mass, wheel,
                                        rolling friction or air drag (0) until they are set. NULL: out of memory */
bp_model *bp_model_copy(const bp_model *model);
void bp_model_free(bp_model *model);

/* Set or get one nominal parameter. BP_E_NAME unknown, BP_E_RANGE outside what is physical. */
int bp_model_set(bp_model *model, const char *parameter, double value);
int bp_model_get(const bp_model *model, const char *parameter, double *value);

/* Switch one effect on with parameter_count values in the order of its table; again: replaces them. */
int bp_model_add_effect(bp_model *model, const char *effect, const double *values);
int bp_model_remove_effect(bp_model *model, const char *effect);

/* The state a run starts from and ends in. */
typedef struct {
    double x, y, heading;         /* m, m, rad */
    double surge, sway, yaw_rate; /* m/s, m/s, rad/s */
    double current[2];            /* A; left, right. A motor uses [0] alone, here and below */
    double wheel_speed[2];        /* rad/s; m/s for a linear motor */
    double wheel_angle[2];        /* rad; m for a linear motor */
    double age;                   /* s since power-on: for what heats and discharges */
    double charge;                /* C drawn from the battery since power-on */
    double heat[2];               /* K of the windings above their surroundings; 0 where nothing heats */
    double rest;                  /* s at rest before the run, in which they cool; 0 once it runs */
} bp_state;

/* One open-loop run: inputs in, outputs out. Sample k holds at time[k], before input k, which acts until time[k + 1].
 */
typedef struct {
    const bp_model *model;
    int samples;         /* 1 or more */
    const double *time;  /* s, strictly increasing, samples long */
    const double *input; /* samples x 2 (left, right) V, or samples x 1 for a motor; NaN: the motor floats */
    bp_state initial;
    double motor_step; /* s, upper limit; 0: 0.0003 */
    double body_step;  /* s, upper limit; 0: 0.003 */
    double *output;    /* samples x (number of output names), filled, noise-free; NaN: this vehicle has no such thing */
    bp_state final;    /* filled */
    int status;        /* filled: 0 or BP_E_ */
} bp_run;

/* Simulates count runs on up to `threads` threads. Returns 0, or the first failing run's status. The same bytes
 * whatever `threads`. */
int bp_simulate(bp_run *runs, int count, int threads);

/* One closed loop: plant, sensors and the firmware, at its 3 ms step, in process. */
enum { BP_SENSORS_IDEAL = 0, BP_SENSORS_IMU = 1, BP_SENSORS_IMU_ENCODERS = 2 };
enum { BP_MAX_WAYPOINTS = 32 };

/* What the firmware is told of this robot beyond its model: its own raw integers, formats in the names and in
 * firmware/app/compensation.h. All zero tells nothing. */
typedef struct {
    short left_gain_q15, left_emf_mv_q15, left_friction_mv, left_offset_mv; /* mV up to 20000; friction from 0 */
    short right_gain_q15, right_emf_mv_q15, right_friction_mv, right_offset_mv;
    short deadband_mv, reserve_mv; /* 0..20000 */
    short half_track_m_q14;        /* 0 or more */
    short battery_sags;            /* 0 or 1 */
    short gyro_bias_mrad_s, gyro_scale_q15;
    short travel_scale_q15, count_mismatch_q15;
} bp_compensation;

typedef struct {
    const bp_model *model;   /* of a BP_DIFF_DRIVE */
    int controller;          /* BP_COUPLED or BP_PAPER: the firmware's set of constants */
    int sensors;             /* BP_SENSORS_ */
    unsigned long long seed; /* of the sensors' noise */
    bp_state initial;
    double motor_step;       /* s; 0: 0.0003 */
    int steps;               /* control steps of 3 ms */
    int start_step;          /* the step at which the mission is commanded to start */
    int waypoint_count;      /* 1..BP_MAX_WAYPOINTS; 0 where `drive` is given */
    const double *waypoints; /* waypoint_count x 2, m, -30..30 */
    double cruise;           /* m/s, up to 2; 0: the firmware's preset */
    const double *drive;     /* steps x 2 V (NaN: floats): a manoeuvre, the controller left out; else NULL */
    double stop_path;        /* m of path after which a manoeuvre shorts both motors; 0: never */
    double *log;             /* steps x (number of log names), filled; or NULL */
    short *motors;           /* steps x 2 duty_q15, filled; or NULL */
    int status;              /* filled: 0 or BP_E_ */

    const bp_compensation *compensation; /* or NULL: none */
} bp_flight;

const char *bp_log_name(int index); /* "time_s", "true_x_m", ...; NULL beyond the last */

/* Flies. Returns flight->status: BP_E_RANGE for a value outside what its field says, another vehicle, or a route that the
 * firmware refuses. The same seed gives the same bytes. */
int bp_fly(bp_flight *flight);

/* The same loop, its controller elsewhere: the caller carries readings to it and its motor commands back. The request is as
 * for bp_fly(), a mission, and its arrays are filled alike, but for the controller's columns of the log, which are 0;
 * controller, start_step, cruise and compensation are the caller's affair. */
typedef struct bp_loop bp_loop;

/* Readings as the firmware's HAL has them: hal/include/hal.h. A status is 0 ok, 1 absent, 2 stale. */
typedef struct {
    unsigned int time_ms;
    int imu_status, rotation_status, battery_status, reference_status;
    short accel_surge_mm_s2, accel_sway_mm_s2, yaw_rate_mrad_s;
    unsigned short rotation_left, rotation_right, battery_mv;
    int x_um, y_um;
    unsigned short heading_bam16;
    short speed_mm_s_q4, true_yaw_rate_mrad_s;
} bp_sensed;

/* NULL: `status` is the BP_E_ code. The request's model and arrays must outlive the loop. */
bp_loop *bp_loop_open(const bp_flight *request, int *status);
void bp_loop_close(bp_loop *loop);

/* Once per step: the sensors are read, with their noise. */
void bp_loop_sense(bp_loop *loop, bp_sensed *sensed);

/* The motors get this duty (32767 = 1) for one step of 3 ms. BP_E_RANGE beyond the last step. */
int bp_loop_act(bp_loop *loop, short left_q15, short right_q15);

#endif
