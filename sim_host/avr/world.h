/* world.h: the robot round the processor: plant, sensors, drives and battery. brickpilot_avr.h documents its use. */
#ifndef BRICKPILOT_SIM_AVR_WORLD_H
#define BRICKPILOT_SIM_AVR_WORLD_H

#include "avr/chip.h"
#include "models/rcx_gen.h"
#include "plant/plant.h"
#include "run/flight_log.h"
#include "sensors/encoder.h"
#include "sensors/imu.h"

enum { PER_CONTROL_STEP = (int)(RCX_BODY_STEP / RCX_MOTOR_STEP + 0.5) };

typedef struct {
    chip_t chip;
    plant_t plant;
    bp_flight request;
    int step;        /* control step that comes next */
    int motor_steps; /* number of motor steps since power-on */
    int status;      /* 0, or BP_E_ of the plant */
    imu_t imu;
    imu_config_t imu_config;
    imu_reading_t noise; /* bias and noise of the control step */
    imu_reading_t measured;
    double specific_force[2][PER_CONTROL_STEP]; /* m/s^2: surge and sway in the last motor steps */
    encoder_config_t encoder_config;
    double battery_v; /* battery voltage in V, set by a fault; 0: the model's voltage */
    double output[OUTPUT_COUNT];
    double duty[SIDES];     /* duty of the last motor step; NaN: the motor coasted */
    double duty_sum[SIDES]; /* sum of the duties since the control step began */
} world_t;

/* Sets up the robot round `world->chip`, which is open. Returns 0 or BP_E_. */
int world_start(world_t *world, const bp_flight *request);

/* Lets one motor step pass. Returns 0 or BP_E_. */
int world_pass(world_t *world);

/* Lets one control step pass and logs it. Returns 0 or BP_E_. */
int world_fly(world_t *world);

/* Sets the battery's voltage; 0: the model's voltage. */
void world_set_battery(world_t *world, double volts);

#endif
