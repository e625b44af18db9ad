/* los.h: line-of-sight guidance along a route, eq. 22.
 *
 * Each leg has three phases. In BRAKE the demanded speed is 0 and the heading is held, until the robot rests. In TURN
 * the robot turns on the spot, until it points at the waypoint. In DRIVE it drives towards the waypoint. BRAKE and TURN
 * are left out if the bearing is within pivot_bam16 of the heading. The route ends when the robot rests within the
 * acceptance radius of the last waypoint, or has driven through this radius and rests. Distances are integers in mm and
 * saturate at 32.7 m on an axis. Left and right are treated alike.
 */
#ifndef BRICKPILOT_AUTOPILOT_LOS_H
#define BRICKPILOT_AUTOPILOT_LOS_H

#include "autopilot/route.h"
#include "core/fix.h"
#include "core/signals.h"

typedef struct {
    uint16_t acceptance_mm;      /* a waypoint is reached within this distance, 1..32767 */
    uint16_t bearing_hold_mm;    /* nearer than this, TURN and DRIVE hold the bearing, since it would swing; 0..32767 */
    int16_t cruise_mm_s_q4;      /* largest speed in DRIVE, 1..32767 */
    int16_t creep_mm_s_q4;       /* least speed in DRIVE, 0..cruise; larger values count as cruise */
    uint16_t decel_mm_s2;        /* deceleration: speed is at most sqrt(2 * decel * distance); 1..32767 */
    uint16_t pivot_bam16;        /* a heading error above this is corrected at rest, by a TURN; 1..32767 */
    uint16_t align_bam16;        /* TURN ends within this heading error, 1..pivot */
    uint16_t rest_speed_mm_s_q4; /* BRAKE ends at or below this speed ... */
    uint16_t rest_ms;            /* ... after this time at or below it */
    uint16_t rest_yaw_rate_mrad_s; /* TURN ends at or below this yaw rate ... */
    uint16_t settle_ms;            /* ... after this time at or below it with the heading aligned */
    uint16_t overshoot_mm;         /* the robot overshoots when it passes the waypoint by more than this, 1..32767 */
    uint8_t max_overshoots;        /* allowed overshoots per leg; one more fails the leg; 255: no limit */
    bool skip_failed;        /* after a failed leg, go on to the next waypoint; the last leg always ends the route */
    uint32_t leg_timeout_ms; /* a leg that takes longer fails; 0..2^31-1 */
} los_config_t;

/* Modes and phases are bytes: on the RCX, comparing a byte with a constant takes half the code of comparing a word. */
enum { LOS_BEGIN = 0, LOS_BRAKE = 1, LOS_TURN = 2, LOS_DRIVE = 3, LOS_END = 4 };
typedef uint8_t los_phase_t;

enum {
    LOS_UNDERWAY = 0,
    LOS_ARRIVED = 1,   /* the last waypoint is reached, and the robot rests */
    LOS_TIMED_OUT = 2, /* a leg took too long, so the route has failed */
    LOS_OVERSHOT = 3
};
typedef uint8_t los_status_t;

/* With all fields 0, the next step begins the route at its first waypoint, wherever the robot is. */
typedef struct {
    fix_vector_t to_mm; /* from the robot to the waypoint */
    int32_t to_x_um;    /* the same vector in um */
    int32_t to_y_um;
    int32_t distance_squared_mm2;
    uint16_t sight_bam16; /* direction to the waypoint; not updated when a leg fails, nor after the end */

    los_phase_t phase;
    los_status_t status;
    uint8_t waypoint;            /* index of the waypoint that the robot steers to; the last one after arrival */
    uint8_t skipped;             /* number of waypoints that the robot has given up */
    bool last_reached;           /* the last waypoint is reached; the robot brakes */
    bool passing;                /* the robot has not overshot the waypoint since it began to DRIVE */
    uint8_t leg_overshoots;      /* overshoots on this leg */
    uint16_t overshoots;         /* overshoots on all legs; saturates at 65535 */
    uint16_t bearing_bam16;      /* bearing of the waypoint; kept constant near the waypoint */
    int16_t heading_error_bam16; /* bearing minus heading */
    int16_t cross_track_mm;      /* distance from the leg's line; positive to the right of it */
    fix_vector_t pass_q15;       /* direction to the waypoint when DRIVE began: normal of the overshoots' plane */
    fix_vector_t
        left_q15; /* direction to the left of the leg's line, which runs from the previous waypoint to this one */
    uint16_t hold_heading_bam16; /* heading when BRAKE began */
    uint16_t quiet_ms;           /* how long the condition that ends the phase has held */
    uint32_t leg_ms;             /* time on this leg */
} los_state_t;

/* Sets the state to zero. */
void los_reset(los_state_t *los);

/* One step of estimate->period_ms. `route` was set by route_set() and `estimate` is valid. Sets speed and heading of
 * `demand`; the mode decides whether to drive at all. A leg fails when it takes too long or is overshot too often.
 * After the end (arrived or failed) only the cross-track and heading errors are updated, until los_reset(). */
void los_step(const los_config_t *config, const route_t *route, los_state_t *los, const signals_estimate_t *estimate,
              signals_demand_t *demand);

#endif
