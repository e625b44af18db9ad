#include "avr/world.h"

#include <math.h>
#include <string.h>

enum { STEP_CYCLES = (int)(CHIP_HZ * RCX_MOTOR_STEP + 0.5) };
_Static_assert(STEP_CYCLES == 4800, "a motor step is a whole number of cycles");
static const double TURN = 6.283185307179586;

static double battery(const world_t *world)
{
    return world->battery_v > 0 ? world->battery_v : world->plant.vehicle.parameter[PARAMETER_BATTERY_VOLTAGE];
}

/* Draws bias and noise for one control step: the sensors' bandwidth of 160 Hz lets them change no faster. */
static void draw_noise(world_t *world)
{
    static const imu_reading_t NOTHING = {0, 0, 0};
    world->noise = imu_read(&world->imu_config, &world->imu, &NOTHING);
}

static double limited(double value, double range)
{
    return value > range ? range : value < -range ? -range : value;
}

/* An accelerometer shows the mean over a control step, as in bp_fly(): its bandwidth is near 160 Hz. */
static double mean_force(world_t *world, int axis, double now)
{
    double *last = world->specific_force[axis];
    double sum = 0;

    last[world->motor_steps % PER_CONTROL_STEP] = now;
    for (int i = 0; i < PER_CONTROL_STEP; i++)
        sum += last[i];
    return sum / PER_CONTROL_STEP;
}

static void set_volts(world_t *world, int input, double value)
{
    const wiring_analog_t *analog = &world->chip.wiring->analog[input];
    world->chip.volts[input] = (analog->zero + value / analog->per_count) * 5.0 / 1024;
}

/* Changes the sign if board.h says that the axis is reversed. */
static double mounted(const world_t *world, int input, double value)
{
    return world->chip.wiring->analog[input].per_count < 0 ? -value : value;
}

/* Sets the converter's voltages and what the digital IMUs measure from the state that the plant has just reached. */
static void sense(world_t *world)
{
    const imu_config_t *imu = &world->imu_config;
    const double *out = world->output;
    /* Ratio of the battery voltage to its nominal value, as the effects of the supply leave it. */
    const double supply = out[OUTPUT_BATTERY_VOLTAGE] / world->plant.vehicle.parameter[PARAMETER_BATTERY_VOLTAGE];

    world->measured =
        (imu_reading_t){.accel_surge = mean_force(world, 0, out[OUTPUT_ACCEL_SURGE]) + world->noise.accel_surge,
                        .accel_sway = mean_force(world, 1, out[OUTPUT_ACCEL_SWAY]) + world->noise.accel_sway,
                        .yaw_rate = out[OUTPUT_YAW_RATE] + world->noise.yaw_rate};
    const i2c_motion_t felt = {.yaw = limited(world->measured.yaw_rate, imu->gyro_range),
                               .surge = limited(world->measured.accel_surge, imu->accel_range),
                               .sway = limited(world->measured.accel_sway, imu->accel_range)};
    set_volts(world, ANALOG_GYRO, felt.yaw);
    set_volts(world, ANALOG_SURGE, felt.surge);
    set_volts(world, ANALOG_SWAY, felt.sway);
    for (int kind = 0; kind < I2C_IMUS; kind++)
        world->chip.imu[kind].motion = (i2c_motion_t){.yaw = mounted(world, ANALOG_GYRO, felt.yaw),
                                                      .surge = mounted(world, ANALOG_SURGE, felt.surge),
                                                      .sway = mounted(world, ANALOG_SWAY, felt.sway)};
    set_volts(world, ANALOG_BATTERY, battery(world) * supply);
}

static double counts(const world_t *world, double wheel_angle)
{
    return wheel_angle / TURN * world->encoder_config.counts_per_turn;
}

static void turn_wheels(world_t *world, const double before[OUTPUT_COUNT])
{
    static const int ANGLE[SIDES] = {OUTPUT_WHEEL_ANGLE_LEFT, OUTPUT_WHEEL_ANGLE_RIGHT};
    static const int SPEED[SIDES] = {OUTPUT_WHEEL_SPEED_LEFT, OUTPUT_WHEEL_SPEED_RIGHT};

    for (int side = 0; side < SIDES; side++) {
        const quadrature_track_t track = {
            .counts = {counts(world, before[ANGLE[side]]), counts(world, world->output[ANGLE[side]])},
            .rate = {counts(world, before[SPEED[side]]), counts(world, world->output[SPEED[side]])},
            .seconds = RCX_MOTOR_STEP,
            .cycles = STEP_CYCLES};
        chip_turn(&world->chip, side, &track);
    }
}

/* Moves the plant with the drives' duty of the step that has just ended. The sensor edges of this motion come in the
 * step that begins. */
static void on_step(void *owner)
{
    world_t *world = owner;
    double before[OUTPUT_COUNT], voltage[SIDES];

    memcpy(before, world->output, sizeof before);
    for (int side = 0; side < SIDES; side++) {
        world->duty[side] = bridge_duty(&world->chip.bridge[side]);
        bridge_clear(&world->chip.bridge[side]);
        voltage[side] = world->duty[side] * battery(world);
        world->duty_sum[side] += isnan(world->duty[side]) ? 0 : world->duty[side];
    }
    if (world->status == 0)
        world->status = plant_advance(&world->plant, voltage, RCX_MOTOR_STEP);
    plant_outputs(&world->plant, world->output);
    if (++world->motor_steps % PER_CONTROL_STEP == 0)
        draw_noise(world);
    sense(world);
    turn_wheels(world, before);
}

/* Takes the sensors of the request, or of the packaged robot if the request has none. Does not round: the processor's
 * converter rounds. */
static void choose_devices(world_t *world)
{
    const bp_devices *devices = world->request.devices;

    world->imu_config = imu_config_default();
    world->encoder_config = encoder_config_default();
    if (devices != NULL) {
        world->imu_config = (imu_config_t){.accel_noise_sd = devices->accel_noise_sd,
                                           .accel_range = devices->accel_range,
                                           .accel_bias_surge = devices->accel_bias_surge,
                                           .accel_bias_sway = devices->accel_bias_sway,
                                           .gyro_noise_sd = devices->gyro_noise_sd,
                                           .gyro_range = devices->gyro_range,
                                           .gyro_bias = devices->gyro_bias};
        world->encoder_config.counts_per_turn = devices->counts_per_turn;
    }
    world->imu_config.bits = 0;
}

int world_start(world_t *world, const bp_flight *request)
{
    world->request = *request;
    choose_devices(world);
    imu_start(&world->imu, request->seed);
    world->status = plant_start(&world->plant, request->model, &request->initial, request->motor_step, 0);
    if (world->status != 0)
        return world->status;
    plant_outputs(&world->plant, world->output);
    draw_noise(world);
    sense(world);
    chip_supply(&world->chip, battery(world));
    chip_every(&world->chip, STEP_CYCLES, on_step, world);
    return 0;
}

int world_pass(world_t *world)
{
    chip_run_step(&world->chip);
    return world->status;
}

void world_set_battery(world_t *world, double volts)
{
    world->battery_v = volts;
    chip_supply(&world->chip, battery(world));
}

/* Logs what the sensors show now. The drives' columns stay 0 until log_drives() fills them. */
static void log_row(world_t *world, double *row)
{
    static const double NOT_YET[SIDES] = {0, 0};
    const double *out = world->output;
    sil_port_t port = {0};

    port.rotation.left = (uint16_t)world->chip.encoder[LEFT].count;
    port.rotation.right = (uint16_t)world->chip.encoder[RIGHT].count;
    flight_log_row(row, world->step * RCX_BODY_STEP, &world->plant, out, &world->measured, &port, NOT_YET, NULL);
}

static void log_drives(const world_t *world, double *row, short *motors)
{
    const char *const NAMES[SIDES] = {"left_voltage_v", "right_voltage_v"};

    for (int side = 0; side < SIDES; side++) {
        const double duty = world->duty_sum[side] / PER_CONTROL_STEP;
        if (motors != NULL)
            motors[side] = (short)lrint(duty * 32767);
        for (int column = 0; row != NULL && column < FLIGHT_LOG_COLUMNS; column++)
            if (strcmp(flight_log_name(column), NAMES[side]) == 0)
                row[column] = duty * battery(world);
    }
}

int world_fly(world_t *world)
{
    const size_t step = (size_t)world->step;
    double *row = world->request.log == NULL ? NULL : world->request.log + step * FLIGHT_LOG_COLUMNS;
    short *motors = world->request.motors == NULL ? NULL : world->request.motors + 2 * step;

    if (world->step >= world->request.steps)
        return BP_E_RANGE;
    world->duty_sum[LEFT] = world->duty_sum[RIGHT] = 0;
    if (row != NULL)
        log_row(world, row);
    for (int i = 0; i < PER_CONTROL_STEP && world->status == 0; i++)
        chip_run_step(&world->chip);
    log_drives(world, row, motors);
    world->step++;
    return world->status;
}
