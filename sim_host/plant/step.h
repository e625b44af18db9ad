/* step.h: one body step, for one robot or for several side by side.
 *
 * The file that includes this header first defines stepped_t, which has a `vehicle` and `wheels`, and these functions,
 * which reach its effects:
 *   bool has_hooks(const stepped_t *plant, site_t site)     any robot has an effect there
 *   void run_hooks(stepped_t *plant, site_t site)           runs these effects
 *   void set_motors(stepped_t *plant)                       the nominal motors, then the hooks of SITE_MOTOR
 *   void sense(stepped_t *plant, double step)               the outputs with the hooks of SITE_SENSOR, where there are any
 */
#ifndef BRICKPILOT_PLANT_STEP_H
#define BRICKPILOT_PLANT_STEP_H

#include <stdbool.h>
#include <string.h>

#include "plant/body.h"
#include "plant/contact.h"

/* Largest number of attempts at a motor step to find the slip of tyres that begin to slip in it. */
enum { STEP_SLIP_TRIES = 4 };

/* True if the state has neither an infinity nor a NaN. */
IN_LANES mask_t step_finite(const state_t *state)
{
    const real_t *value = (const real_t *)state; /* a state is made of numbers alone */
    real_t sum = real_of(0);
    for (size_t i = 0; i < sizeof *state / sizeof *value; i++)
        sum += value[i] * 0;
    return sum == 0;
}

/* Converts the commands into the voltages at the motors. */
static inline void step_drive(stepped_t *plant, const real_t input[2])
{
    vehicle_t *vehicle = &plant->vehicle;
    const int count = vehicle->vehicle == BP_MOTOR ? 1 : 2;
    for (int k = 0; k < count; k++)
        vehicle->command[k] = input[k];
    run_hooks(plant, SITE_TIMING);
    const real_t scale = vehicle->supply / vehicle->parameter[PARAMETER_BATTERY_VOLTAGE];
    for (int k = 0; k < count; k++)
        vehicle->voltage[k] = vehicle->command[k] * scale;
    run_hooks(plant, SITE_DRIVE);
}

static inline bool step_floats_anew(const stepped_t *plant)
{
    const wheels_t *wheels = &plant->wheels;
    const real_t *voltage = plant->vehicle.voltage;
    const mask_t left = is_nan(voltage[0]) != wheels->floats[0], right = is_nan(voltage[1]) != wheels->floats[1];
    return any_lane(left | right);
}

/* One motor step of the wheels and of a body with its own speeds. */
static inline void step_slipping(stepped_t *plant, const contact_t *contact, double h)
{
    vehicle_t *vehicle = &plant->vehicle;
    wheels_t *wheels = &plant->wheels;
    const state_t before = vehicle->state;
    const real_t energy[2] = {wheels->energy[0], wheels->energy[1]};
    contact->expect(wheels, vehicle);
    for (int tries = 0; tries < STEP_SLIP_TRIES; tries++) {
        vehicle->state = before;
        wheels->energy[0] = energy[0];
        wheels->energy[1] = energy[1];
        contact->grip(wheels, vehicle, h);
        wheels_join(wheels);
        wheels_step(wheels, vehicle);
        if (!contact->overloads(wheels, vehicle, h))
            break;
    }
    contact->follow(wheels, vehicle, h);
}

static inline void step_motors(stepped_t *plant, const contact_t *contact, const real_t input[2], double h, int count)
{
    vehicle_t *vehicle = &plant->vehicle;
    const bool drive_varies = has_hooks(plant, SITE_TIMING) || has_hooks(plant, SITE_DRIVE);
    const bool body_moves_alone = contact->grip != NULL;
    const bool wheel_varies = has_hooks(plant, SITE_WHEEL);
    vehicle->step = real_of(h);
    step_drive(plant, input);
    wheels_prepare(&plant->wheels, vehicle, h);
    for (int i = 0; i < count; i++) {
        if (drive_varies && i > 0) {
            step_drive(plant, input);
            if (step_floats_anew(plant))
                wheels_prepare(&plant->wheels, vehicle, h);
        }
        if (wheel_varies) {
            memset(vehicle->wheel_torque, 0, sizeof vehicle->wheel_torque);
            memset(vehicle->dry, 0, sizeof vehicle->dry);
            run_hooks(plant, SITE_WHEEL);
        }
        if (body_moves_alone)
            step_slipping(plant, contact, h);
        else
            wheels_step(&plant->wheels, vehicle);
    }
}

/* Adds the accelerometers' readings of the last body step to `felt`. */
static inline void step_feel(stepped_t *plant)
{
    vehicle_t *vehicle = &plant->vehicle;
    const bool sensed = has_hooks(plant, SITE_SENSOR);
    vehicle->felt[0] += sensed ? vehicle->output[OUTPUT_ACCEL_SURGE] : vehicle->accel_surge;
    vehicle->felt[1] += sensed ? vehicle->output[OUTPUT_ACCEL_SWAY] : vehicle->accel_sway;
}

/* Advances by one body step of `step` s, in `motor_count` motor steps of h s. */
static inline void step_body(stepped_t *plant, const contact_t *contact, const real_t input[2], double step, double h,
                             int motor_count)
{
    vehicle_t *vehicle = &plant->vehicle;
    wheels_t *wheels = &plant->wheels;
    const state_t before = vehicle->state;

    vehicle->step = real_of(step);
    body_prepare(vehicle, step);
    run_hooks(plant, SITE_BODY);
    vehicle->supply = vehicle->parameter[PARAMETER_BATTERY_VOLTAGE];
    run_hooks(plant, SITE_SUPPLY);
    if (has_hooks(plant, SITE_MOTOR))
        set_motors(plant);
    contact->prepare(wheels, vehicle);

    wheels->energy[0] = real_of(0);
    wheels->energy[1] = real_of(0);
    step_motors(plant, contact, input, h, motor_count);
    contact->finish(wheels, vehicle, &before, step);

    const real_t charge = (wheels->energy[0] + wheels->energy[1]) / vehicle->supply;
    vehicle->supply_current = charge / step;
    vehicle->state.charge += charge;
    vehicle->state.age += step;
    sense(plant, step);
    step_feel(plant);
}

/* Call step_sample_begins() before the body steps between two readings, and step_sample_ends() after them. */
static inline void step_sample_begins(stepped_t *plant)
{
    plant->vehicle.felt[0] = plant->vehicle.felt[1] = real_of(-0.0); /* -0 + x is exactly x, even for x = -0 */
}

static inline void step_sample_ends(stepped_t *plant, int body_count)
{
    plant->vehicle.felt[0] = plant->vehicle.felt[0] / body_count;
    plant->vehicle.felt[1] = plant->vehicle.felt[1] / body_count;
}

#endif
