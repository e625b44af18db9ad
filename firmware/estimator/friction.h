/* friction.h: learns dry friction from the accelerometer, and detects that the robot rests although the estimate moves.
 *
 * Friction is a voltage here: each motor needs it in addition to the voltage of the model's motor, to roll straight
 * ahead. The model gets the motors' voltage minus friction, and the speed controller adds friction to its feedforward.
 * The innovation is a step's change of speed by the model minus the change by the accelerometer:
 *
 *   innovation = (acceleration by the model - specific force without its bias) * period
 *   learnt' = learnt + 16 / s * (voltage per acceleration * innovation - (learnt - in force) * period)
 *
 * An accelerometer cannot tell rest from a steady speed. Its integral is a good speed only soon after a rest: an error
 * b of its bias adds the speed b * FRICTION_TRUSTED_MS. So for FRICTION_TRUSTED_MS after a rest, while the motors
 * drive, the speed comes from the accelerometer alone, and friction is learnt. Later the speed comes from the model
 * with the friction in force.
 *
 *   rest as told     the robot has been believed slow for FRICTION_SLOW_MS: the autopilot demands 0 or a faster speed
 *   rest that is     while the robot is believed slow, gyro and accelerometer show only noise in FRICTION_REST_STEPS
 *   seen             steps: the speed is set to 0 (zero-velocity update). A cruise is as quiet, but it is not slow
 *
 * Limits. Friction is 0..FRICTION_MOST_MV: it cannot drive the model. An unknown bias of FRICTION_BIAS_MM_S2 looks
 * like a friction of twice this size, since the bias also adds speed. Up to 2.5 times this bias, no learnt friction is
 * in force; from 3.3 times on, all of it is; in between, the part in force grows without a jump. Nothing is learnt
 * before the accelerometer's bias is known, nor with rotation sensors or a reference, which measure the speed better.
 * If the robot sticks while its estimated speed is not slow, this is detected at its next stop. Negate speed,
 * innovation, acceleration, yaw rate and voltage: friction stays the same, and the voltage that it takes is negated.
 */
#ifndef BRICKPILOT_ESTIMATOR_FRICTION_H
#define BRICKPILOT_ESTIMATOR_FRICTION_H

#include "core/signals.h"

/* A build with -DFRICTION_UNLEARNT learns no friction: for rotation sensors, or a chip with too little memory. */

#define FRICTION_MOST_MV 3000   /* largest friction: the voltage that the heading controller's limit leaves */
#define FRICTION_BIAS_MM_S2 30  /* bias of the accelerometer: accel_bias_surge of sim_host/models/rcx.toml */
#define FRICTION_TRUSTED_MS 400 /* the model's time constant: later the model's speed is better */
#define FRICTION_SLOW_MS 100
#define FRICTION_SLOW_MM_S_Q4 640                   /* 40 mm/s: half of `creep`, the slowest speed demanded */
#define FRICTION_STILL_MM_S_Q4 160                  /* 10 mm/s: below it, the motion has no direction */
#define FRICTION_REST_STEPS (STEP_MS < 6 ? 32 : 16) /* 0.1 s */

typedef struct {
    int16_t mv_per_mm_s2_q10; /* voltage of both motors per acceleration, 0..32767. 0: learns nothing, finds no rest */
    int16_t half_track_m_q14; /* half-track, to compute a side's speed from the yaw rate; 0..32767: up to 2 m */
} friction_config_t;

enum { FRICTION_STILL = 0, FRICTION_ROLLS = 1, FRICTION_TURNS = 2 };

/* All fields are 0 at the start. */
typedef struct {
    uint16_t learnt_mv_q4;    /* learnt friction, 0..FRICTION_MOST_MV */
    int16_t rest_sum_mm_s2;   /* sum of the accelerations of the quiet steps: +-3680 */
    unsigned trusted_ms : 9;  /* time since the last rest, slow steps excluded; stops above FRICTION_TRUSTED_MS */
    unsigned slow_ms : 7;     /* how long the estimated speed has been slow; stops above FRICTION_SLOW_MS */
    unsigned quiet_steps : 6; /* quiet steps in a row, 0..FRICTION_REST_STEPS - 1 */
    unsigned motion : 2;      /* motion in the previous step: FRICTION_STILL, _ROLLS or _TURNS */
} friction_state_t;

/* The inputs of a step. */
typedef struct {
    int32_t innovation_mm_s_q17; /* model minus accelerometer, any value */
    int16_t speed_mm_s_q4;       /* speed estimated in the previous step, any value */
    int16_t accel_mm_s2;         /* forward acceleration without bias, any value */
    int16_t yaw_rate_mrad_s;     /* without bias, any value */
    uint8_t period_ms;           /* 1..20 */
    bool driven;                 /* the motors had a voltage other than 0 */
    bool have_gyro;              /* the yaw rate comes from the gyro */
} friction_input_t;

/* The source of the speed in this step. */
typedef enum { FRICTION_MODEL = 0, FRICTION_ACCELEROMETER, FRICTION_REST } friction_belief_t;

/* Runs a step in which only the accelerometer measures the speed. Returns the source of the speed. */
friction_belief_t friction_step(const friction_config_t *config, friction_state_t *state,
                                const friction_input_t *input);

/* Takes the estimated motion (any value) at the end of every step. */
void friction_take_motion(const friction_config_t *config, friction_state_t *state, int16_t speed_mm_s_q4,
                          int16_t yaw_rate_mrad_s);

/* The friction in force, 0..FRICTION_MOST_MV. */
int16_t friction_mv(const friction_config_t *config, const friction_state_t *state);

/* The voltage that friction takes from motors with the mean voltage `surge_mv` (any), at the speed estimated in the
 * step before. In motion it has the sign of the speed; at rest it is `surge_mv`, up to the friction in force. In a turn
 * on the spot it is 0, since the friction of both sides cancels. */
int16_t friction_takes_mv(const friction_config_t *config, const friction_state_t *state, int16_t speed_mm_s_q4,
                          int16_t surge_mv);

#endif
