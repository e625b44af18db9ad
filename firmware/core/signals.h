/* signals.h: the structs that pass from one stage of a step to the next. Only one stage writes each struct:
 *
 *   sensors    the loop, from the HAL
 *   predicted  the model
 *   estimate   the estimator
 *   demand     the autopilot
 *   effort     the PID controllers
 *   drive      the mixer
 *
 * Frame: the paper's. x forward, y right, z down: heading and yaw rate are positive clockwise seen from above.
 * Names end in unit and format: _q4 is a value times 16, _bam16 a binary angle (65536 = one turn), _q15 a fraction
 * times 32767. Only the rotation sensors are raw counts, which wrap.
 */
#ifndef BRICKPILOT_CORE_SIGNALS_H
#define BRICKPILOT_CORE_SIGNALS_H

#include <stdbool.h>
#include <stdint.h>

/* Period of a control step in ms: a build constant. params_gen.h holds constants for each possible value. */
#ifndef STEP_MS
#define STEP_MS 3
#endif

/* Bits of signals_sensors_t.have: which sensors delivered a valid and fresh value in this step. */
enum {
    SENSOR_GYRO = 1,
    SENSOR_ACCELEROMETER = 2,
    SENSOR_ROTATION = 4,
    SENSOR_REFERENCE = 8, /* the true state, from a simulator or a tracking system */
    SENSOR_BATTERY = 16
};

/* The sensors that this build supports. A build for a brick with fewer sensors, -DSENSORS_POSSIBLE=..., has no code for
 * the missing sensors and never asks the HAL for them. It acts as a full build does when those sensors are absent. */
#ifndef SENSORS_POSSIBLE
#define SENSORS_POSSIBLE (SENSOR_GYRO | SENSOR_ACCELEROMETER | SENSOR_ROTATION | SENSOR_REFERENCE | SENSOR_BATTERY)
#endif

#define SENSOR_POSSIBLE(bits) ((SENSORS_POSSIBLE & (bits)) != 0)

/* True if one of the sensors in `bits` (constants) has a value in this step. A constant false if the build supports
 * none of these sensors. */
#define SIGNALS_HAVE(sensors, bits) (((sensors)->have & ((bits)&SENSORS_POSSIBLE)) != 0)

/* False if the build has only the profile `coupled`, whose wheels cannot slide sideways. */
#ifdef BODY_WITHOUT_PAPER
#define SIGNALS_SWAY false
#else
#define SIGNALS_SWAY true
#endif

/* Loop -> estimator. A field is valid only if its sensor's bit in `have` is set. */
typedef struct {
    uint8_t have;              /* SENSOR_* bits */
    uint8_t period_ms;         /* time since the previous step, 1..20 */
    int16_t accel_surge_mm_s2; /* specific force, -32767..32767 */
    int16_t accel_sway_mm_s2;
    int16_t yaw_rate_mrad_s; /* -32767..32767 */
    uint16_t rotation_left;  /* counts since power-on: wraps at 65536 */
    uint16_t rotation_right;
    uint16_t battery_mv;    /* 0..32000 */
    int32_t reference_x_um; /* -2e9..2e9 */
    int32_t reference_y_um;
    uint16_t reference_heading_bam16;
    int16_t reference_speed_mm_s_q4; /* surge, -32767..32767: +-2.047 m/s */
    int16_t reference_yaw_rate_mrad_s;
} signals_sensors_t;

/* Velocities of the robot's body. */
typedef struct {
    int32_t surge_mm_s_q17; /* +-8.19 m/s */
    int32_t sway_mm_s_q17;
    int32_t yaw_rate_mrad_s_q12; /* +-480 rad/s */
} signals_motion_t;

/* Model -> estimator: the motion that the previous step's voltages should have caused. */
typedef struct {
    signals_motion_t motion;
    bool driven; /* one of these voltages was not 0 */
} signals_predicted_t;

/* Estimator -> autopilot, control, mixer, telemetry. */
typedef struct {
    int32_t x_um; /* +-2147 m, saturates */
    int32_t y_um;
    int32_t travel_um_q5;      /* forward travel since the previous step, +-1613234176 */
    int32_t sway_travel_um_q5; /* travel to the right since the previous step */
    uint16_t heading_bam16;
    int16_t speed_mm_s_q4;   /* surge, saturates at +-2.047 m/s */
    int16_t yaw_rate_mrad_s; /* without the gyro's bias, -32767..32767, saturates */
    int16_t accel_mm_s2;     /* rate of change of speed, filtered, saturates */
    uint8_t period_ms;       /* time since the step before, 1..20 */
    bool at_rest;      /* true from the end of the first block of quiet samples (heading.h) until something moves */
    bool valid;        /* false: the estimate is too poor to steer by */
    bool bias_unknown; /* the heading comes from a gyro whose bias has not been learnt */
} signals_estimate_t;

/* Autopilot -> control. */
typedef struct {
    bool drive; /* false: motors off, integrators cleared */
    int16_t speed_mm_s_q4;
    uint16_t heading_bam16;
} signals_demand_t;

/* Control -> mixer. The left motor gets surge plus yaw, the right motor surge minus yaw. */
typedef struct {
    int16_t surge_mv; /* -32000..32000 */
    int16_t yaw_mv;
} signals_effort_t;

/* Mixer -> motors; in the next step -> model, and -> control for its anti-windup. */
typedef struct {
    int16_t left_mv; /* voltage for a motor like the model's, after saturation */
    int16_t right_mv;
    int16_t left_q15; /* duty, -32767..32767 = -1..1 times the battery voltage */
    int16_t right_q15;
    int8_t surge_saturated; /* 1: the motors get less surge than asked for; -1: more; 0: exactly as much */
    int8_t yaw_saturated;   /* the same for yaw */
} signals_drive_t;

#endif
