/* states.h: numbers for, and a hash of, the structs that several modules' vectors need. What is drawn keeps to the ranges that
 * the structs' headers state, and meets their ends. */
#ifndef BRICKPILOT_VECTORS_STATES_H
#define BRICKPILOT_VECTORS_STATES_H

#include "app/params_gen.h"

/* The constants of the profile that this build is about. */
#ifdef BODY_WITHOUT_COUPLED
#define PARAMS PARAMS_PAPER
#else
#define PARAMS PARAMS_COUPLED
#endif

/* What the vectors' sensors have at most: a full build is fed what one for fewer is with -DDRAWN_SENSORS. */
#ifndef DRAWN_SENSORS
#define DRAWN_SENSORS SENSORS_POSSIBLE
#endif

void draw_sensors(signals_sensors_t *sensors);
void draw_estimate(signals_estimate_t *estimate);

/* Moves on what draw_estimate() drew: a robot about `waypoint`, that looks more or less along `bearing_bam16`. */
void draw_estimate_about(signals_estimate_t *estimate, const route_waypoint_t *waypoint, uint16_t bearing_bam16);

enum { DRAWN_WAYPOINTS = 8 };

/* A route of 1..8 waypoints, held in `waypoints`. */
void draw_route(route_t *route, route_waypoint_t waypoints[DRAWN_WAYPOINTS]);
void draw_los_config(los_config_t *config);
void draw_drive_config(drive_config_t *config);

void hash_body_state(const body_state_t *state);
void hash_los_state(const los_state_t *state);
void hash_mode_state(const mode_state_t *state, const signals_demand_t *demand);
void hash_pid_output(const pid_output_t *output);
void hash_drive(const signals_drive_t *drive);
void hash_demand(const signals_demand_t *demand);

#endif
