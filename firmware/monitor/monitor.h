/* monitor.h: says which cause makes a wheel differ from the model, how much, and since when. It reads only: no other stage
 * uses its results.
 *
 * Every MONITOR_BLOCK_MS it computes for each wheel the innovation: the voltage that the measured motion needs by the
 * model, minus the voltage that the motor got. The motion is that of the estimate: travel and yaw rate give the wheel's
 * speed, their changes its acceleration. All voltages are integrals over the block, in units of 64 mV ms.
 *
 *   innovation = E + A - U      E = back EMF and losses of the speed, A = voltage of the acceleration, U = motor's voltage
 *
 * A cause of size t changes the innovation by -t * signature:
 *
 *   dry friction         sign of the speed      t in mV
 *   braking with speed   E                      t a share: of back EMF and losses
 *   supply               U                      t a share: of the voltage, that drive and leads do not pass on
 *   slip                 A of the yaw alone     t a share: of the inertia that seems to be added
 *   supply, battery      load: sum of U (U - E) t a share: resistance of the battery by that of a motor. Its innovation is
 *                        the battery's reading before the first drive minus the reading now
 *
 * Each signature has a two-sided CUSUM of the log likelihood ratio between a cause of the size looked for
 * (MONITOR_SHARE; friction_mv) and none, and a recursive least squares estimate of its size t with forgetting.
 * With e and x in standard deviations of the innovation, for a cause of the size looked for,
 *
 *   sum' = max(0, sum + min(cap, +-x e - x x / 2))   b' = b + x e - b / 256   a' = a + x x - a / 256   size = b / a
 *
 * The alarm is given when a sum reaches the threshold h. By Lorden's bound the mean time between false alarms of one
 * CUSUM is then at least exp(h) blocks, if the innovations are independent and have this standard deviation or less.
 * While all sums are near 0 there is no evidence: b and a are 0, and the cause sets in after that. The cause is the one
 * whose estimate explains most, b b / a. It is named if its lead over the second is clear and the evidence is older than
 * MONITOR_DECIDE_MS. Then it keeps this name until another lead is clear, or until MONITOR_HOLD_BLOCKS had no evidence.
 *
 * A least squares estimate of all four causes together is not possible: since U = E + A where nothing is wrong, supply is
 * the sum of braking and slip. So one cause at a time is assumed, and each has an estimate of its own.
 * What cannot be told apart: slip, and a larger yaw inertia; braking, and a larger wheel or a weaker motor; a cause
 * that sets in while another one acts. A wheel slower than `slowest` says nothing.
 *
 * Cost: one signature of one wheel a step. Negate every input and the state: sizes stay, the rest is negated.
 */
#ifndef BRICKPILOT_MONITOR_MONITOR_H
#define BRICKPILOT_MONITOR_MONITOR_H

#include "core/signals.h"

/* A build with -DMONITOR_OFF has no monitor. */

#define MONITOR_BLOCK_MS 96
#define MONITOR_SHARE 200       /* size looked for, 1/1000, of all causes but friction: half of it raises a sum */
#define MONITOR_MOST_SD_Q6 2048 /* innovations and signatures are limited to 32 standard deviations */
#define MONITOR_MEMORY_BITS 8   /* the estimates of sizes forget in 2^8 blocks: 25 s of driving */
#define MONITOR_HOLD_BLOCKS 50  /* a cause is withdrawn after so many blocks without evidence: 5 s of driving */
#define MONITOR_DECIDE_MS 3000  /* no cause is named sooner after its onset */
#define MONITOR_QUIET_Q5 32     /* sums below 1 are no evidence */

enum {
    MONITOR_NONE = 0,
    MONITOR_UNDECIDED, /* something is wrong, but its cause is not clear yet */
    MONITOR_FRICTION,
    MONITOR_BRAKING,
    MONITOR_SUPPLY,
    MONITOR_SLIP
};
typedef uint8_t monitor_cause_t;

enum { MONITOR_LEFT = 0, MONITOR_RIGHT = 1, MONITOR_BATTERY = 2, MONITOR_CHANNELS = 3, MONITOR_SIGNATURES = 4 };

typedef struct {
    int16_t per_sd_q15;         /* 64 standard deviations of innovation per 64 mV ms, 0..32767. 0: the monitor is off */
    int16_t share_q15;          /* the same for signatures, times the size looked for, 0..32767 */
    int16_t friction_q6;        /* friction looked for, in standard deviations, 0..2048 */
    int16_t friction_mv;        /* friction looked for, 1..32767 */
    int16_t slowest;            /* least E of a wheel [64 mV ms] in a block that is used, 0..32767 */
    int16_t mv_per_mm_s_q10;    /* E per speed of a wheel, 0..32767 */
    int16_t surge_q10;          /* A [64 mV ms] per change of speed [1/16 mm/s], 0..32767 */
    int16_t yaw_q10;            /* A [64 mV ms] per change of yaw rate [mrad/s], 0..32767 */
    int16_t half_track_m_q14;   /* 0..32767: up to 2 m */
    int16_t battery_per_sd_q15; /* as per_sd_q15, for the battery, 0..32767 */
    int16_t load_q15;           /* the battery's signature per load, 0..32767 */
    int16_t threshold_q5;       /* h, 32..32767 */
} monitor_config_t;

/* One signature. */
typedef struct {
    int16_t sum_q5[2];   /* CUSUM for a loss and for a gain, 0..threshold_q5 */
    int32_t product_q12; /* b, +-2^30 */
    int32_t square_q12;  /* a, 0..2^30 */
} monitor_signature_t;

/* What a channel says. */
typedef struct {
    uint32_t since_ms; /* end of the last block without evidence, on the monitor's clock */
    int16_t size;      /* friction: mV; else 1/1000. Above 0: a loss */
    monitor_cause_t cause;
} monitor_report_t;

/* Evidence of a channel in the present block: the best explanation, and how well the second one explains. */
typedef struct {
    int32_t best_q7;
    int32_t second_q7;
    int16_t size;
    int16_t peak_q5; /* the largest sum */
    monitor_cause_t cause;
} monitor_rank_t;

/* Sums over a block. */
typedef struct {
    int32_t travel_um_q5;
    int32_t angle_urad;
    int32_t voltage_mv_ms[2];
    int32_t battery_mv_ms;
    int16_t speed_mm_s_q4; /* change since the block's start */
    int16_t yaw_rate_mrad_s;
    uint16_t period_ms; /* the block's length */
    bool bad;           /* the estimate was not valid in a step */
} monitor_sums_t;

/* All fields are 0 at the start. */
typedef struct {
    monitor_signature_t wheel[2][MONITOR_SIGNATURES];
    monitor_signature_t battery;
    monitor_report_t report[MONITOR_CHANNELS];
    monitor_sums_t sums;  /* of the block that runs */
    monitor_sums_t block; /* of the block before, whose jobs are done one a step */
    monitor_rank_t rank;
    uint32_t clock_ms; /* time since the start, wraps */
    int16_t innovation_q6;
    int16_t signature_q6[MONITOR_SIGNATURES];
    int16_t load;          /* sum over the wheels */
    int16_t speed_mm_s_q4; /* at the end of the last step */
    int16_t yaw_rate_mrad_s;
    uint16_t reference_mv;                  /* the battery's reading before the first drive */
    uint8_t jobs;                           /* jobs left of `block` */
    uint8_t quiet_blocks[MONITOR_CHANNELS]; /* since a reported cause had evidence, 0..MONITOR_HOLD_BLOCKS */
    bool evidence[MONITOR_CHANNELS];        /* a sum was not near 0, or a cause is reported */
    bool has_driven;
} monitor_state_t;

/* One step of estimate->period_ms, 1..20. `drive` has the motors' voltages since the step before, any values; `battery_mv`
 * is the newest reading, 0..32000. Reads travel, speed, yaw rate and `valid` of `estimate`, any values. Never fails: it
 * saturates. state->report has the results. */
void monitor_step(const monitor_config_t *config, monitor_state_t *state, const signals_estimate_t *estimate,
                  const signals_drive_t *drive, uint16_t battery_mv);

#endif
