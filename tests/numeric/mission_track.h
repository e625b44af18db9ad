/* mission_track.h: one mission flown by the firmware or by the double controller, and how far two tracks are apart.
 *
 * Every flight is 60 s long, with ideal sensors, from rest at the origin; start is commanded in the first step.
 */
#ifndef BRICKPILOT_TESTS_MISSION_TRACK_H
#define BRICKPILOT_TESTS_MISSION_TRACK_H

#include "app/loop.h"
#include "double_controller.h"

enum { MISSION_STEPS = 20000, MISSION_WAYPOINTS = 8 };

typedef struct {
    int profile;                             /* BP_COUPLED or BP_PAPER: of the plant and of the controller */
    int count;                               /* 1..MISSION_WAYPOINTS */
    double waypoints[2 * MISSION_WAYPOINTS]; /* m, whole millimetres */
    double heading;                          /* rad, at the start */
    double cruise;                           /* m/s */
} mission_t;

typedef struct {
    double x[MISSION_STEPS], y[MISSION_STEPS]; /* m: the true position, when step k begins */
    double reached[MISSION_WAYPOINTS]; /* s: when the controller took it for reached, the last one when it came to rest
                                          there; NaN: never */
} track_t;

/* The firmware on the host plant, by bp_fly(). */
void mission_fly_firmware(const mission_t *mission, track_t *track);

/* The double controller on the host plant. */
void mission_fly_double(const mission_t *mission, const double_constants_t *constants, track_t *track);

/* The firmware, with the constants given, on its own fixed-point model. */
void mission_fly_model(const mission_t *mission, const loop_config_t *config, track_t *track);

/* The firmware, with the constants given, on double_paper_body.h. */
void mission_fly_paper_body(const mission_t *mission, const loop_config_t *config, track_t *track);

/* Distances are taken from the start until both have arrived.
 *
 * Largest distance of the positions at equal times, m. */
double mission_apart(const mission_t *mission, const track_t *a, const track_t *b);

/* Largest distance of a position of either track from the other track's curve within 3 s, m. */
double mission_curves_apart(const mission_t *mission, const track_t *a, const track_t *b);

/* Largest difference of the times at which a waypoint was reached, s. Infinite where a track misses one. */
double mission_times_apart(const mission_t *mission, const track_t *a, const track_t *b);

#endif
