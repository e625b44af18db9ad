/* signals.h: the only structs that cross from one stage of the pipeline to the next.
 *
 * Frame: the paper's. x forward, y right, z down: heading and yaw rate are positive clockwise seen from above.
 * Units and formats are in the names: _q4 is a value times 16, _bam16 a binary angle (65536 = one turn),
 * _q15 a share times 32767. Nothing here is ever a raw sensor count but the rotation sensors, whose counts wrap.
 */
#ifndef BRICKPILOT_CORE_SIGNALS_H
#define BRICKPILOT_CORE_SIGNALS_H

#include <stdbool.h>
#include <stdint.h>

/* The control step, ms: a build constant, 3 or what params_gen.h has constants for. */
#ifndef STEP_MS
#define STEP_MS 3
#endif

/* Bits of signals_sensors_t.have: what the HAL delivered, valid and fresh, in this step. */
enum {
    SENSOR_GYRO = 1,
    SENSOR_ACCELEROMETER = 2,
    SENSOR_ROTATION = 4,
    SENSOR_REFERENCE = 8, /* the true state: a simulator's, or a tracked arena's */
    SENSOR_BATTERY = 16
};

/* The sensors that this build can ever have. One for a brick that lacks some, -DSENSORS_POSSIBLE=..., carries no code for them: it
 * never asks the HAL, and does otherwise what a full build does without them. */
#ifndef SENSORS_POSSIBLE
#define SENSORS_POSSIBLE (SENSOR_GYRO | SENSOR_ACCELEROMETER | SENSOR_ROTATION | SENSOR_REFERENCE | SENSOR_BATTERY)
#endif

#define SENSOR_POSSIBLE(bits) ((SENSORS_POSSIBLE & (bits)) != 0)

/* Whether there is one of `bits`, constants, in this step: false at compile time where none of them is possible. */
#define SIGNALS_HAVE(signals, bits) (((signals)->sensors.have & ((bits)&SENSORS_POSSIBLE)) != 0)

/* hal -> estimator. Fields whose bit is not set hold no meaning. */
typedef struct {
    uint8_t have;              /* SENSOR_* bits */
    uint8_t period_ms;         /* time since the step before, 1..20 */
    int16_t accel_surge_mm_s2; /* specific force, -32767..32767 */
    int16_t accel_sway_mm_s2;
    int16_t yaw_rate_mrad_s; /* -32767..32767 */
    uint16_t rotation_left;  /* counts since power-on: wraps at 65536 */
    uint16_t rotation_right;
    uint16_t battery_mv;    /* 0..20000 */
    int32_t reference_x_um; /* -2e9..2e9 */
    int32_t reference_y_um;
    uint16_t reference_heading_bam16;
    int16_t reference_speed_mm_s_q4; /* surge, -32767..32767: +-2.047 m/s */
    int16_t reference_yaw_rate_mrad_s;
} signals_sensors_t;

/* model -> estimator: what the voltages applied should have done by now. */
typedef struct {
    int32_t surge_mm_s_q17; /* +-8.19 m/s */
    int32_t sway_mm_s_q17;
    int32_t yaw_rate_mrad_s_q12; /* +-480 rad/s */
} signals_motion_t;

/* estimator -> autopilot, control, telemetry. The estimator's stages go on from what it holds of the step before; all zero, or x_um
 * and y_um set to where the robot stands, to begin with. */
typedef struct {
    int32_t x_um; /* +-2147 m, saturates */
    int32_t y_um;
    uint16_t heading_bam16;
    int16_t speed_mm_s_q4;   /* surge, saturates at +-2.047 m/s */
    int16_t yaw_rate_mrad_s; /* bias removed, -32767..32767, saturates */
    int16_t accel_mm_s2;     /* rate of change of speed, filtered, saturates */
    bool at_rest; /* wheels and body stand still: from the end of the first quiet block until something moves */
    bool valid;   /* false: too little to steer by */

    /* What the estimator works on, and its stages tell each other; nobody else's. */
    bool driven; /* a motor got another voltage than 0 in the step that has passed */
    signals_sensors_t sensors;
    const signals_motion_t *predicted;
    int32_t travel_um_q5;      /* forward since the step before, +-2^26 */
    int32_t sway_travel_um_q5; /* to the right */
} signals_state_t;

/* Wheels that cannot slide, those of the model's profile `coupled`, never sway: false where a build has no other. */
#ifdef BODY_WITHOUT_PAPER
#define SIGNALS_SWAY false
#else
#define SIGNALS_SWAY true
#endif

/* autopilot -> control. */
typedef struct {
    bool drive; /* false: motors off, integrators cleared */
    int16_t speed_mm_s_q4;
    uint16_t heading_bam16;
} signals_demand_t;

/* control -> mixer. Motor voltage: each motor gets surge, plus yaw on the left and minus yaw on the right. */
typedef struct {
    int16_t surge_mv; /* -20000..20000 */
    int16_t yaw_mv;
} signals_effort_t;

/* mixer -> motors, and back to control as its anti-windup. */
typedef struct {
    int16_t left_mv; /* what the motor will get: after saturation */
    int16_t right_mv;
    int16_t left_q15; /* duty, -32767..32767 = -1..1 times the battery voltage */
    int16_t right_q15;
    int8_t surge_saturated; /* 1: more surge was asked than given; -1: less (more negative); 0: given in full */
    int8_t yaw_saturated;   /* the same for yaw */
} signals_drive_t;

#endif
