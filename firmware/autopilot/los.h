/* los.h: line-of-sight guidance along a route, eq. 22.
 *
 * Each leg has three phases. BRAKE: speed 0 and the heading held, until the robot rests. TURN: on the spot, until it
 * points at the waypoint. DRIVE: towards the waypoint; the last one is reached once the robot rests behind it. BRAKE
 * and TURN are left out where the bearing is within pivot_bam16 of the heading. Distances are integers in mm;
 * beyond 32.7 m on an axis they saturate. Left and right are treated alike.
 */
#ifndef BRICKPILOT_AUTOPILOT_LOS_H
#define BRICKPILOT_AUTOPILOT_LOS_H

#include "autopilot/route.h"
#include "core/fix.h"
#include "core/signals.h"

typedef struct {
    uint16_t acceptance_mm;   /* a waypoint is reached within this distance, 1..32767 */
    uint16_t bearing_hold_mm; /* within this distance TURN and DRIVE keep their bearing, which would swing; 0..32767 */
    int16_t cruise_mm_s_q4;   /* 1..32767 */
    int16_t creep_mm_s_q4;    /* never slower in DRIVE; 0..cruise */
    uint16_t decel_mm_s2;     /* speed is at most sqrt(2 decel distance); 1..32767 */
    uint16_t pivot_bam16;     /* a larger heading error is turned off at rest; 1..32767 */
    uint16_t align_bam16;     /* TURN ends within this heading error, 1..pivot */
    uint16_t rest_speed_mm_s_q4;   /* BRAKE ends at or below this speed ... */
    uint16_t rest_ms;              /* ... kept for so long */
    uint16_t rest_yaw_rate_mrad_s; /* TURN ends at or below this yaw rate ... */
    uint16_t settle_ms;            /* ... and aligned for so long */
    uint16_t overshoot_mm;         /* past the waypoint by more than this is an overshoot, 1..32767 */
    uint8_t max_overshoots;        /* per leg; the next one fails the leg; 255: none does */
    bool skip_failed;              /* a failed leg: go on to the next waypoint; the last one always ends the route */
    uint32_t leg_timeout_ms;       /* a leg that takes longer fails; 0..2^31-1 */
} los_config_t;

/* Kept in bytes, as all names of states are: the RCX compares a byte with a constant in half of what a word takes. */
enum { LOS_BEGIN = 0, LOS_BRAKE = 1, LOS_TURN = 2, LOS_DRIVE = 3, LOS_END = 4 };
typedef uint8_t los_phase_t;

enum {
    LOS_UNDERWAY = 0,
    LOS_ARRIVED = 1,   /* the last waypoint is reached, and the robot rests */
    LOS_TIMED_OUT = 2, /* a leg failed, and the route with it */
    LOS_OVERSHOT = 3
};
typedef uint8_t los_status_t;

/* All zero: the next step begins the route at its first waypoint, from wherever the robot is. */
typedef struct {
    /* What the newest step was about: every step makes it new, and nobody looks through the pointers after it. */
    const los_config_t *config;
    const route_t *route;
    const signals_state_t *signals;
    signals_demand_t demand; /* its answer; whether to drive at all is the mode's */

    int32_t to_x_um; /* from the robot to the waypoint */
    int32_t to_y_um;
    fix_pair_t to_mm;
    int32_t distance_squared_mm2;
    uint16_t sight_bam16; /* the direction of the waypoint; not made new where a leg fails or after the end */

    los_phase_t phase;
    los_status_t status;
    uint8_t waypoint;            /* index of the one steered to; stays at the last when arrived */
    uint8_t skipped;             /* waypoints given up */
    bool last_reached;           /* what is left is to brake */
    bool passing;                /* since the last DRIVE the waypoint has not been overshot */
    uint8_t leg_overshoots;      /* on this leg */
    uint16_t overshoots;         /* of all legs; stays at 65535 */
    uint16_t bearing_bam16;      /* to the waypoint, held near it */
    int16_t heading_error_bam16; /* bearing minus heading */
    int16_t cross_track_mm;      /* from the leg's line, right of it positive */
    fix_pair_t pass_q15;         /* ahead at the beginning of DRIVE: normal to the plane of the overshoot rule */
    fix_pair_t left_q15;         /* of the leg's line, from the waypoint before to this one */
    uint16_t hold_heading_bam16; /* at the beginning of BRAKE */
    uint16_t quiet_ms;           /* how long the condition that ends the phase has held */
    uint32_t leg_ms;             /* time on this leg */
} los_state_t;

/* All zero but the demand: the next step begins the route again. */
void los_reset(los_state_t *los);

/* One step, of signals->sensors.period_ms, 1..255. `route` holds a route that route_set() took; `signals` is valid. A leg fails on
 * time-out or overshoots; past the end (arrived or failed) nothing but cross-track and heading error changes until los_reset(). */
void los_step(const los_config_t *config, const route_t *route, los_state_t *los, const signals_state_t *signals);

#endif
