/* friction.h: dry friction that nobody stated, learnt from the accelerometer, and rest that is seen although the robot is believed
 * to move.
 *
 * Friction is a voltage here: what each motor needs beyond the model to roll straight ahead. The model gets the motors' voltage
 * less it, and the speed controller adds it to its feedforward. The innovation says how much faster the model got in a step than
 * the accelerometer:
 *
 *   innovation = (acceleration by the model - specific force without its bias) * period
 *   learnt' = learnt + 16 / s * (voltage per acceleration * innovation - (learnt - in force) * period)
 *
 * An accelerometer cannot tell rest from a steady speed. Its integral is the speed only while a rest is near: an error b of its
 * bias adds b * FRICTION_TRUSTED_MS. So it alone is believed for that long after a rest, while the motors drive, and friction is learnt then.
 * Later the speed is the model's, less the friction in force.
 *
 *   rest as told     the robot has been believed slow for FRICTION_SLOW_MS. The autopilot tells it to stop, or to drive faster
 *   rest that is     while it is believed slow, gyro and accelerometer show no more than noise in FRICTION_REST_STEPS steps: the
 *   seen             speed is set to 0 (zero-velocity update). A cruise is as quiet, but it is not slow
 *
 * Limits. Friction is 0..FRICTION_MOST_MV: it cannot drive the model. A bias of FRICTION_BIAS_MM_S2 that was not learnt feigns
 * a friction of twice that, with the speed that it adds. Up to 2.5 times it is not in force, from 3.3 times on all is, and in
 * between it grows without a jump. Nothing is learnt before the accelerometer's bias is known, nor with rotation sensors or a
 * reference, which tell the speed better. A robot that sticks while it is believed faster than slow is found at its next stop.
 * Negate speed, innovation, acceleration, yaw rate and voltage: friction stays, and what it takes is negated.
 */
#ifndef BRICKPILOT_ESTIMATOR_FRICTION_H
#define BRICKPILOT_ESTIMATOR_FRICTION_H

#include "core/signals.h"

/* A build with -DFRICTION_UNLEARNT has no code and no state for this: with rotation sensors, or where there is no room. */

#define FRICTION_MOST_MV 3000   /* what the limit of the heading's controller leaves */
#define FRICTION_BIAS_MM_S2 30  /* of the accelerometer: accel_bias_surge of sim_host/models/rcx.toml */
#define FRICTION_TRUSTED_MS 400 /* the time constant of the model: later the model knows the speed better */
#define FRICTION_SLOW_MS 100
#define FRICTION_SLOW_MM_S_Q4 640                   /* 40 mm/s: half of `creep`, the slowest speed that is told */
#define FRICTION_STILL_MM_S_Q4 160                  /* 10 mm/s: below it, motion has no direction */
#define FRICTION_REST_STEPS (STEP_MS < 6 ? 32 : 16) /* 0.1 s */

typedef struct {
    int16_t mv_per_mm_s2_q10; /* voltage of both motors per acceleration, 0..32767. 0: learns nothing, sees no rest */
    int16_t half_track_m_q14; /* makes a side's speed of the yaw rate, 0..32767: up to 2 m */
} friction_config_t;

enum { FRICTION_STILL = 0, FRICTION_ROLLS = 1, FRICTION_TURNS = 2 };

/* All zero at the start. */
typedef struct {
    uint16_t learnt_mv_q4;    /* 0..FRICTION_MOST_MV */
    int16_t rest_sum_mm_s2;   /* accelerations of the quiet steps: +-3680 */
    unsigned trusted_ms : 9;  /* not slow since the last rest for so long; stays where it passes FRICTION_TRUSTED_MS */
    unsigned slow_ms : 7;     /* believed slow for so long; stays where it passes FRICTION_SLOW_MS */
    unsigned quiet_steps : 6; /* 0..FRICTION_REST_STEPS - 1 */
    unsigned motion : 2;      /* one of these, of the step before */
} friction_state_t;

/* What a step shows. */
typedef struct {
    int32_t innovation_mm_s_q17; /* any */
    int16_t speed_mm_s_q4;       /* estimated in the step before, any */
    int16_t accel_mm_s2;         /* without bias, any */
    int16_t yaw_rate_mrad_s;     /* without bias, any */
    uint8_t period_ms;           /* 1..20 */
    bool driven;                 /* the motors had a voltage */
    bool have_gyro;              /* the yaw rate is the gyro's */
} friction_input_t;

/* Who tells the speed in this step. */
typedef enum { FRICTION_MODEL = 0, FRICTION_ACCELEROMETER, FRICTION_REST } friction_belief_t;

/* A step in which the accelerometer is all that measures the speed. */
friction_belief_t friction_step(const friction_config_t *config, friction_state_t *state,
                                const friction_input_t *input);

/* Takes the estimated motion, any, at the end of every step. */
void friction_take_motion(const friction_config_t *config, friction_state_t *state, int16_t speed_mm_s_q4,
                          int16_t yaw_rate_mrad_s);

/* The friction in force, 0..FRICTION_MOST_MV. */
int16_t friction_mv(const friction_config_t *config, const friction_state_t *state);

/* The voltage that friction takes from motors with `surge_mv` (any) in the mean, at the speed estimated in the step before: along
 * the motion, or at rest all of it up to its size. None in a turn on the spot, where those of the sides cancel. */
int16_t friction_takes_mv(const friction_config_t *config, const friction_state_t *state, int16_t speed_mm_s_q4,
                          int16_t surge_mv);

#endif
