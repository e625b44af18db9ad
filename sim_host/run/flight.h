/* flight.h: one closed loop of plant and sensors, shared by fly.c (the firmware in process) and loop.c (a controller
 * outside). */
#ifndef BRICKPILOT_RUN_FLIGHT_H
#define BRICKPILOT_RUN_FLIGHT_H

#include "app/parameters.h"
#include "models/rcx_gen.h"
#include "run/flight_log.h"
#include "sensors/battery.h"
#include "sensors/encoder.h"

#define FLIGHT_STEP_S RCX_BODY_STEP /* control step of the plant, and of the packaged firmware */
enum { PLANT_STEP_MS = (int)(RCX_BODY_STEP * 1e3 + 0.5) };

typedef struct {
    const bp_flight *request; /* the request, its arrays and the plant must outlive the flight */
    plant_t *plant;
    int step; /* the present control step, or the next one */
    sil_port_t port;
    loop_state_t loop;
    route_waypoint_t waypoints[BP_MAX_WAYPOINTS];
    route_t route;
    parameters_t parameters;
    imu_t imu;
    imu_config_t imu_config;
    encoder_config_t encoder_config;
    battery_config_t battery_config;
    imu_reading_t measured;
    double output[OUTPUT_COUNT];
    double path;
} flight_t;

/* Starts the plant, the sensors and the settings of a request; the controller is not started. BP_E_RANGE: as bp_fly(). */
int flight_prepare(flight_t *flight, const bp_flight *request, plant_t *plant);

/* Reads the sensors of this moment, with their noise, into the port. */
void flight_sense(flight_t *flight);

/* Converts the duties in the port into `voltage`, in V. */
void flight_commanded_voltage(const flight_t *flight, double voltage[2]);

/* Stores the step's log and motor commands, and goes on to the next step. `loop`: NULL if the controller is outside. */
void flight_keep_step(flight_t *flight, const double voltage[2], const loop_state_t *loop);

/* Advances the plant by a control step with `voltage`, in V. In step `later_step` the plant gets the later model first.
 * Returns 0 or a BP_E_ code. */
int flight_advance(flight_t *flight, const double voltage[2]);

/* Rounds a number to an integer within +-32767. */
int16_t flight_int16(double value);

#endif
