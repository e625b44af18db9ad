/* flight.c: one closed loop of plant, sensors and controller. bp_fly() has the firmware in process; with bp_loop_ the
 * caller carries readings and commands to a controller elsewhere. brickpilot_sim.h is the manual. */
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "app/parameters.h"
#include "app/params_gen.h"
#include "brickpilot_sim.h"
#include "models/rcx_gen.h"
#include "plant/lanes.h"
#include "run/flight_log.h"
#include "sensors/battery.h"
#include "sensors/encoder.h"

static const double STEP_S = RCX_BODY_STEP; /* of the plant, and of the packaged firmware */
enum { PLANT_STEP_MS = (int)(RCX_BODY_STEP * 1e3 + 0.5) };
_Static_assert((int)BP_MAX_WAYPOINTS == (int)ROUTE_WAYPOINTS_MAX &&
                   BP_MAX_COORDINATE_M * 1000 == (int)ROUTE_COORDINATE_MAX_MM,
               "brickpilot_sim.h states the limits of firmware/autopilot/route.h");
_Static_assert(STEP_MS % PLANT_STEP_MS == 0,
               "a step of the firmware is one of the plant, [rates] body_step, or several");
static const double TURN = 6.283185307179586;

typedef struct {
    const bp_flight *request;
    int step; /* the control step that comes next, or is under way */
    plant_t *plant;
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

static int16_t to_int16(double value)
{
    return value > 32767 ? (int16_t)32767 : value < -32767 ? (int16_t)-32767 : (int16_t)lrint(value);
}

static int32_t to_int32(double value)
{
    return value > 2e9 ? 2000000000 : value < -2e9 ? -2000000000 : (int32_t)lrint(value);
}

static uint16_t to_bam16(double angle)
{
    return (uint16_t)llrint(angle * (65536.0 / TURN));
}

/* Puts the readings of this moment into the port. */
static void sense(flight_t *flight)
{
    const int sensors = flight->request->sensors;
    const double *out = flight->output;
    const bp_state *state = &flight->plant->vehicle.state;
    sil_port_t *port = &flight->port;
    imu_reading_t truth;

    plant_outputs(flight->plant, flight->output);
    truth = (imu_reading_t){out[OUTPUT_ACCEL_SURGE], out[OUTPUT_ACCEL_SWAY], out[OUTPUT_YAW_RATE]};
    flight->measured = sensors == BP_SENSORS_IDEAL ? truth : imu_read(&flight->imu_config, &flight->imu, &truth);
    port->clock_ms = (uint32_t)flight->step * PLANT_STEP_MS;
    port->imu = (hal_imu_t){to_int16(flight->measured.accel_surge * 1e3), to_int16(flight->measured.accel_sway * 1e3),
                            to_int16(flight->measured.yaw_rate * 1e3)};
    port->rotation.left = (uint16_t)encoder_read(&flight->encoder_config, out[OUTPUT_WHEEL_ANGLE_LEFT]);
    port->rotation.right = (uint16_t)encoder_read(&flight->encoder_config, out[OUTPUT_WHEEL_ANGLE_RIGHT]);
    port->battery_mv = (uint16_t)to_int16(battery_read(&flight->battery_config, out[OUTPUT_BATTERY_VOLTAGE]) * 1e3);
    port->reference = (hal_reference_t){to_int32(state->x * 1e6), to_int32(state->y * 1e6), to_bam16(state->heading),
                                        to_int16(state->surge * 16e3), to_int16(state->yaw_rate * 1e3)};
}

/* Puts the constants and the request's settings in force. False: there is no such setting, or a value is out of its
 * range. */
static bool write_settings(const bp_flight *request, parameters_t *parameters)
{
#ifdef BODY_WITHOUT_PAPER
    if (request->controller == BP_PAPER)
        return false;
    parameters_start(parameters, &PARAMS_COUPLED);
#else
    parameters_start(parameters, request->controller == BP_PAPER ? &PARAMS_PAPER : &PARAMS_COUPLED);
#endif
    if (request->cruise > 0)
        parameters->config.step.mode.los.cruise_mm_s_q4 = to_int16(request->cruise * 16e3);
    for (int i = 0; i < request->setting_count; i++) {
        const bp_setting *setting = &request->settings[i];
        if (setting->number < 0 || setting->number > 255 ||
            parameters_write(parameters, (uint8_t)setting->number, setting->raw, false) != PARAMETERS_OK)
            return false;
    }
    return true;
}

/* Gives the flight the sensors that the request describes, or else the packaged robot's. */
static void choose_devices(flight_t *flight)
{
    const bp_devices *devices = flight->request->devices;

    flight->imu_config = imu_config_default();
    flight->encoder_config = encoder_config_default();
    flight->battery_config = battery_config_default();
    if (devices == NULL)
        return;
    flight->imu_config = (imu_config_t){.accel_noise_sd = devices->accel_noise_sd,
                                        .accel_range = devices->accel_range,
                                        .accel_bias_surge = devices->accel_bias_surge,
                                        .accel_bias_sway = devices->accel_bias_sway,
                                        .gyro_noise_sd = devices->gyro_noise_sd,
                                        .gyro_range = devices->gyro_range,
                                        .gyro_bias = devices->gyro_bias,
                                        .bits = devices->bits};
    flight->encoder_config.counts_per_turn = devices->counts_per_turn;
    flight->battery_config.resolution = devices->battery_resolution;
}

static int prepare(flight_t *flight)
{
    const bp_flight *request = flight->request;

    if (!write_settings(request, &flight->parameters))
        return BP_E_RANGE;
    choose_devices(flight);
    imu_start(&flight->imu, request->seed);

    flight->port.imu_status = request->sensors == BP_SENSORS_IDEAL ? HAL_ABSENT : HAL_OK;
    flight->port.rotation_status = request->sensors == BP_SENSORS_IMU_ENCODERS ? HAL_OK : HAL_ABSENT;
    flight->port.reference_status = request->sensors == BP_SENSORS_IDEAL ? HAL_OK : HAL_ABSENT;
    flight->port.battery_status = HAL_OK;

    for (int i = 0; i < request->waypoint_count; i++)
        flight->waypoints[i] = (route_waypoint_t){to_int16(request->waypoints[2 * i] * 1e3),
                                                  to_int16(request->waypoints[2 * i + 1] * 1e3)};
    if (request->waypoint_count > 0 &&
        route_set(&flight->route, flight->waypoints, (uint8_t)request->waypoint_count) != ROUTE_OK)
        return BP_E_RANGE;
    return plant_start(flight->plant, request->model, &request->initial, request->motor_step, 0);
}

/* Sets the voltages of a manoeuvre: those of its schedule, and 0 once its path is done. */
static void follow_schedule(flight_t *flight, double voltage[2])
{
    const bp_flight *request = flight->request;
    const int step = flight->step;
    const double battery = flight->plant->vehicle.parameter[PARAMETER_BATTERY_VOLTAGE];
    const bool done = request->stop_path > 0 && flight->path >= request->stop_path;

    for (int side = 0; side < 2; side++)
        voltage[side] = done ? 0 : request->drive[2 * step + side];
    flight->port.left_q15 = isnan(voltage[0]) ? (int16_t)0 : to_int16(voltage[0] / battery * 32767);
    flight->port.right_q15 = isnan(voltage[1]) ? (int16_t)0 : to_int16(voltage[1] / battery * 32767);
    flight->path += fabs(flight->plant->vehicle.state.surge) * STEP_S;
}

/* Runs the firmware in process, where a step of it is due: that of an RCX is longer than the plant's. The motors keep
 * their duty between two steps. */
static void control(flight_t *flight)
{
    const int every = STEP_MS / PLANT_STEP_MS;
    const int begins =
        (flight->request->start_step + every - 1) / every * every; /* the command waits until a step is due */

    flight->port.link_out_size = 0;
    if (flight->step % every == 0)
        loop_tick(&flight->parameters.config, &flight->route, &flight->loop,
                  flight->step == begins ? MODE_START : MODE_NONE);
}

static void commanded_voltage(const flight_t *flight, double voltage[2])
{
    const double battery = flight->plant->vehicle.parameter[PARAMETER_BATTERY_VOLTAGE];

    voltage[0] = flight->port.left_q15 / 32767.0 * battery;
    voltage[1] = flight->port.right_q15 / 32767.0 * battery;
}

/* Writes the step into the log: a whole row, or its place in each of the chosen columns. */
static void log_step(const flight_t *flight, const double voltage[2], const loop_state_t *loop)
{
    const bp_flight *request = flight->request;
    const size_t step = (size_t)flight->step;
    double chosen_from[FLIGHT_LOG_COLUMNS];
    double *row = request->columns != NULL ? chosen_from : request->log + step * FLIGHT_LOG_COLUMNS;

    flight_log_row(row, flight->step * STEP_S, flight->plant, flight->output, &flight->measured, &flight->port, voltage,
                   loop);
    for (int i = 0; request->columns != NULL && i < request->column_count; i++)
        request->log[(size_t)i * (size_t)request->steps + step] = row[request->columns[i]];
}

/* Keeps what happens in the step, and goes on to the next. `loop` is NULL where the controller is not in process. */
static void keep_step(flight_t *flight, const double voltage[2], const loop_state_t *loop)
{
    const bp_flight *request = flight->request;
    const size_t step = (size_t)flight->step;

    if (request->motors != NULL) {
        request->motors[2 * step] = flight->port.left_q15;
        request->motors[2 * step + 1] = flight->port.right_q15;
    }
    if (request->log != NULL)
        log_step(flight, voltage, loop);
    flight->step++;
}

/* Does a step up to the voltages at which the plant has to advance. */
static void fly_step(flight_t *flight, double voltage[2])
{
    const bool manoeuvre = flight->request->drive != NULL;

    sense(flight);
    if (manoeuvre) {
        follow_schedule(flight, voltage);
    } else {
        sil_bind(&flight->port);
        control(flight);
        commanded_voltage(flight, voltage);
    }
    keep_step(flight, voltage, manoeuvre ? NULL : &flight->loop);
}

static int fly(flight_t *flight)
{
    int status = 0;

    while (status == 0 && flight->step < flight->request->steps) {
        double voltage[2];
        fly_step(flight, voltage);
        status = plant_advance(flight->plant, voltage, STEP_S);
    }
    return status;
}

static bool can_be_flown(const bp_flight *request)
{
    bool sound =
        request->model != NULL && request->model->vehicle == BP_DIFF_DRIVE && request->steps >= 1 &&
        request->start_step >= 0 && request->sensors >= BP_SENSORS_IDEAL &&
        request->sensors <= BP_SENSORS_IMU_ENCODERS &&
        (request->controller == BP_COUPLED || request->controller == BP_PAPER) && request->cruise >= 0 &&
        request->cruise <= 2 && request->stop_path >= 0 && request->setting_count >= 0 &&
        (request->settings != NULL || request->setting_count == 0) &&
        (request->devices == NULL || (request->devices->counts_per_turn > 0 && request->devices->bits >= 0 &&
                                      request->devices->bits <= 24 && request->devices->battery_resolution > 0));
    if (request->drive == NULL)
        sound = sound && request->waypoints != NULL && request->waypoint_count >= 1 &&
                request->waypoint_count <= BP_MAX_WAYPOINTS;
    else
        sound = sound && request->waypoint_count == 0;
    for (int i = 0; sound && request->drive == NULL && i < 2 * request->waypoint_count; i++)
        sound = isfinite(request->waypoints[i]);
    for (int i = 0; sound && request->columns != NULL && i < request->column_count; i++)
        sound = request->columns[i] >= 0 && request->columns[i] < FLIGHT_LOG_COLUMNS;
    return sound;
}

const char *bp_log_name(int index)
{
    return flight_log_name(index);
}

/* Gets a flight ready to fly with this plant, or says why that cannot be. */
static int begin(flight_t *flight, const bp_flight *request, plant_t *plant)
{
    memset(flight, 0, sizeof *flight);
    flight->request = request;
    flight->plant = plant;
    if (!can_be_flown(request))
        return BP_E_RANGE;
    const int status = prepare(flight);
    if (status == 0) {
        sil_bind(&flight->port);
        loop_start(&flight->loop);
    }
    return status;
}

int bp_fly(bp_flight *request)
{
    plant_t plant;
    flight_t flight;

    request->status = begin(&flight, request, &plant);
    if (request->status == 0)
        request->status = fly(&flight);
    sil_bind(NULL);
    return request->status;
}

/* Flights whose plants advance side by side. */
typedef struct {
    lanes_t lanes;
    flight_t flight[LANES_MOST];
    bp_flight *request[LANES_MOST];
} side_by_side_t;

static void fly_lanes(side_by_side_t *side, int count)
{
    lanes_t *lanes = &side->lanes;

    lanes_open(lanes, count);
    for (int done = 0; done < side->request[0]->steps; done++) {
        double voltage[LANES_MOST][2] = {{0}};
        for (int lane = 0; lane < count; lane++) {
            if (lanes->status[lane] != 0)
                continue;
            if (done > 0)
                lanes_tell(lanes, lane);
            fly_step(&side->flight[lane], voltage[lane]);
        }
        lanes_advance(lanes, voltage, STEP_S);
    }
    for (int lane = 0; lane < count; lane++)
        side->request[lane]->status = lanes->status[lane];
}

/* Begins each flight. One that fails, or whose plant does not fit into a lane, is done here; the others go on side by
 * side. */
static void fly_group(side_by_side_t *side, bp_flight *requests, int count)
{
    int kept = 0;

    for (int i = 0; i < count; i++) {
        flight_t *flight = &side->flight[kept];
        plant_t *plant = &side->lanes.plant[kept];
        requests[i].status = begin(flight, &requests[i], plant);
        if (requests[i].status != 0)
            continue;
        if (lanes_may_hold(plant))
            side->request[kept++] = &requests[i];
        else
            requests[i].status = fly(flight);
    }
    if (kept > 1)
        fly_lanes(side, kept);
    else if (kept == 1)
        side->request[0]->status = fly(&side->flight[0]);
    sil_bind(NULL);
}

static bool go_together(const bp_flight *a, const bp_flight *b)
{
    return a->model != NULL && b->model != NULL && a->model->vehicle == b->model->vehicle &&
           a->model->profile == b->model->profile && a->steps == b->steps &&
           memcmp(&a->motor_step, &b->motor_step, sizeof a->motor_step) == 0;
}

int bp_fly_many(bp_flight *requests, int count, int lanes)
{
    const int widest = lanes_widest(lanes);
    side_by_side_t *side = widest > 1 && count > 1 ? malloc(sizeof *side) : NULL;
    int status = 0;

    for (int i = 0, together; i < count; i += together) {
        together = 1;
        while (side != NULL && together < widest && i + together < count &&
               go_together(&requests[i], &requests[i + together]))
            together++;
        if (together > 1)
            fly_group(side, &requests[i], together);
        else
            bp_fly(&requests[i]);
    }
    free(side);
    for (int i = 0; i < count && status == 0; i++)
        status = requests[i].status;
    return status;
}

int bp_plant_size(void)
{
    return (int)sizeof(lanes_t); /* which holds plants */
}

struct bp_loop {
    bp_flight request;
    plant_t plant;
    flight_t flight;
};

bp_loop *bp_loop_open(const bp_flight *request, int *status)
{
    bp_loop *loop;

    *status = BP_E_RANGE;
    if (!can_be_flown(request) || request->drive != NULL)
        return NULL;
    *status = BP_E_MEMORY;
    loop = calloc(1, sizeof *loop);
    if (loop == NULL)
        return NULL;
    loop->request = *request;
    loop->flight.request = &loop->request;
    loop->flight.plant = &loop->plant;
    *status = prepare(&loop->flight);
    if (*status == 0)
        return loop;
    free(loop);
    return NULL;
}

void bp_loop_sense(bp_loop *loop, bp_sensed *sensed)
{
    const sil_port_t *port = &loop->flight.port;

    sense(&loop->flight);
    *sensed = (bp_sensed){.time_ms = port->clock_ms,
                          .imu_status = (int)port->imu_status,
                          .rotation_status = (int)port->rotation_status,
                          .battery_status = (int)port->battery_status,
                          .reference_status = (int)port->reference_status,
                          .accel_surge_mm_s2 = port->imu.accel_surge_mm_s2,
                          .accel_sway_mm_s2 = port->imu.accel_sway_mm_s2,
                          .yaw_rate_mrad_s = port->imu.yaw_rate_mrad_s,
                          .rotation_left = port->rotation.left,
                          .rotation_right = port->rotation.right,
                          .battery_mv = port->battery_mv,
                          .x_um = port->reference.x_um,
                          .y_um = port->reference.y_um,
                          .heading_bam16 = port->reference.heading_bam16,
                          .speed_mm_s_q4 = port->reference.speed_mm_s_q4,
                          .true_yaw_rate_mrad_s = port->reference.yaw_rate_mrad_s};
}

int bp_loop_act(bp_loop *loop, short left_q15, short right_q15)
{
    flight_t *flight = &loop->flight;
    double voltage[2];

    if (flight->step >= loop->request.steps)
        return BP_E_RANGE;
    flight->port.left_q15 = left_q15;
    flight->port.right_q15 = right_q15;
    commanded_voltage(flight, voltage);
    keep_step(flight, voltage, NULL);
    return plant_advance(flight->plant, voltage, STEP_S);
}

void bp_loop_close(bp_loop *loop)
{
    free(loop);
}
