/* flight.c: functions for closed loops, with the firmware or with a controller outside. brickpilot_sim.h is the
 * manual. */
#include "run/flight.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "app/params_gen.h"
#include "brickpilot_sim.h"

_Static_assert((int)BP_MAX_WAYPOINTS == (int)ROUTE_WAYPOINTS_MAX &&
                   BP_MAX_COORDINATE_M * 1000 == (int)ROUTE_COORDINATE_MAX_MM,
               "brickpilot_sim.h states the limits of firmware/autopilot/route.h");
static const double TURN = 6.283185307179586;

int16_t flight_int16(double value)
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

static bool can_be_flown(const bp_flight *request)
{
    bool sound =
        request->model != NULL && request->model->vehicle != BP_MOTOR && request->steps >= 1 &&
        request->start_step >= 0 && request->sensors >= BP_SENSORS_IDEAL &&
        request->sensors <= BP_SENSORS_IMU_ENCODERS &&
        (request->controller == BP_COUPLED || request->controller == BP_PAPER) && request->cruise >= 0 &&
        request->cruise <= 2 && request->stop_path >= 0 && request->setting_count >= 0 &&
        (request->settings != NULL || request->setting_count == 0) &&
        (request->devices == NULL || (request->devices->counts_per_turn > 0 && request->devices->bits >= 0 &&
                                      request->devices->bits <= 24 && request->devices->battery_resolution > 0));
    if (request->later != NULL)
        sound = sound && request->later->vehicle == request->model->vehicle &&
                request->later->profile == request->model->profile && request->later_step >= 0;
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

void flight_sense(flight_t *flight)
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
    port->imu =
        (hal_imu_t){flight_int16(flight->measured.accel_surge * 1e3), flight_int16(flight->measured.accel_sway * 1e3),
                    flight_int16(flight->measured.yaw_rate * 1e3)};
    port->rotation.left = (uint16_t)encoder_read(&flight->encoder_config, out[OUTPUT_WHEEL_ANGLE_LEFT]);
    port->rotation.right = (uint16_t)encoder_read(&flight->encoder_config, out[OUTPUT_WHEEL_ANGLE_RIGHT]);
    port->battery_mv = (uint16_t)flight_int16(battery_read(&flight->battery_config, out[OUTPUT_BATTERY_VOLTAGE]) * 1e3);
    port->reference = (hal_reference_t){to_int32(state->x * 1e6), to_int32(state->y * 1e6), to_bam16(state->heading),
                                        flight_int16(state->surge * 16e3), flight_int16(state->yaw_rate * 1e3)};
}

/* Sets the constants and the request's settings. False: there is no such setting, or a value is outside its range. */
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
        parameters->config.step.mode.los.cruise_mm_s_q4 = flight_int16(request->cruise * 16e3);
    for (int i = 0; i < request->setting_count; i++) {
        const bp_setting *setting = &request->settings[i];
        if (setting->number < 0 || setting->number > 255 ||
            parameters_write(parameters, (uint8_t)setting->number, setting->raw, false) != PARAMETERS_OK)
            return false;
    }
    return true;
}

/* Gives the flight the sensors of the request, or of the packaged robot if the request has none. */
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

int flight_prepare(flight_t *flight, const bp_flight *request, plant_t *plant)
{
    memset(flight, 0, sizeof *flight);
    flight->request = request;
    flight->plant = plant;
    if (!can_be_flown(request) || !write_settings(request, &flight->parameters))
        return BP_E_RANGE;
    choose_devices(flight);
    imu_start(&flight->imu, request->seed);

    flight->port.imu_status = request->sensors == BP_SENSORS_IDEAL ? HAL_ABSENT : HAL_OK;
    flight->port.rotation_status = request->sensors == BP_SENSORS_IMU_ENCODERS ? HAL_OK : HAL_ABSENT;
    flight->port.reference_status = request->sensors == BP_SENSORS_IDEAL ? HAL_OK : HAL_ABSENT;
    flight->port.battery_status = HAL_OK;

    for (int i = 0; i < request->waypoint_count; i++)
        flight->waypoints[i] = (route_waypoint_t){flight_int16(request->waypoints[2 * i] * 1e3),
                                                  flight_int16(request->waypoints[2 * i + 1] * 1e3)};
    if (request->waypoint_count > 0 &&
        route_set(&flight->route, flight->waypoints, (uint8_t)request->waypoint_count) != ROUTE_OK)
        return BP_E_RANGE;
    return plant_start(flight->plant, request->model, &request->initial, request->motor_step, 0);
}

void flight_commanded_voltage(const flight_t *flight, double voltage[2])
{
    const double battery = flight->plant->vehicle.parameter[PARAMETER_BATTERY_VOLTAGE];

    voltage[0] = flight->port.left_q15 / 32767.0 * battery;
    voltage[1] = flight->port.right_q15 / 32767.0 * battery;
}

/* Writes the step into the log: a whole row, or one value in each of the chosen columns. */
static void log_step(const flight_t *flight, const double voltage[2], const loop_state_t *loop)
{
    const bp_flight *request = flight->request;
    const size_t step = (size_t)flight->step;
    double chosen_from[FLIGHT_LOG_COLUMNS];
    double *row = request->columns != NULL ? chosen_from : request->log + step * FLIGHT_LOG_COLUMNS;

    flight_log_row(row, flight->step * FLIGHT_STEP_S, flight->plant, flight->output, &flight->measured, &flight->port,
                   voltage, loop);
    for (int i = 0; request->columns != NULL && i < request->column_count; i++)
        request->log[(size_t)i * (size_t)request->steps + step] = row[request->columns[i]];
}

void flight_keep_step(flight_t *flight, const double voltage[2], const loop_state_t *loop)
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

int flight_advance(flight_t *flight, const double voltage[2])
{
    const bp_flight *request = flight->request;
    plant_t *plant = flight->plant;

    if (request->later != NULL && flight->step == request->later_step + 1) { /* flight_keep_step() has counted on */
        const bp_state state = plant->vehicle.state;
        const int status = plant_start(plant, request->later, &state, request->motor_step, 0);
        if (status != 0)
            return status;
    }
    return plant_advance(plant, voltage, FLIGHT_STEP_S);
}

const char *bp_log_name(int index)
{
    return flight_log_name(index);
}
