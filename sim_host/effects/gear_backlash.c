#include "effects/effect.h"

/* The plant's wheel carries the rotor's inertia J_m and feels the torque K_t i. Let the rotor turn faster than the wheel
 * by `slip`. Then the wheel must feel K_t i - J_m slip' instead. In contact nothing changes. In the play the
 * motor drives only the rotor. When the rotor meets the tooth, momentum is conserved. */
typedef struct {
    real_t play;  /* angle of the rotor ahead of the wheel, from the middle of the play, rad */
    real_t slip;  /* rad/s: rate of `play` */
    real_t speed; /* rad/s of the wheel, a motor step ago; NaN after an impact */
    real_t accel; /* rad/s^2 of the wheel */
} mesh_t;

static void start(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)value;
    mesh_t *mesh = (mesh_t *)memory;
    for (int k = 0; k < 2; k++)
        mesh[k].speed = vehicle->state.wheel_speed[k];
}

/* The back EMF follows the rotor's speed, not the wheel's. */
static void drive(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)value;
    const mesh_t *mesh = (const mesh_t *)memory;
    for (int k = 0; k < 2; k++)
        vehicle->voltage[k] -= vehicle->motor[k].emf_constant * mesh[k].slip;
}

/* A drive that commands force has no inertia of its own, so the rotor gets this share of the mass. */
static real_t rotor_inertia(const vehicle_t *vehicle, int k, real_t share)
{
    const real_t own = vehicle->motor[k].inertia;
    return share * choose(own > 0, own, vehicle->build.mass);
}

/* Torque that turns the rotor relative to the wheel. `damping`: by how much it falls per unit of `slip`. */
static real_t push(const vehicle_t *vehicle, int k, real_t inertia, real_t accel, real_t *damping)
{
    const motor_t *motor = &vehicle->motor[k];
    const real_t voltage = vehicle->voltage[k];
    const mask_t floats = is_nan(voltage);
    *damping = choose(floats, real_of(0), motor->torque_constant * motor->emf_constant / motor->resistance);
    const real_t direct = choose(floats, real_of(0), motor->torque_per_volt * voltage);
    return motor->torque_constant * vehicle->state.current[k] + direct - inertia * accel;
}

static void turn(mesh_t *mesh, vehicle_t *vehicle, int k, real_t gap, real_t share)
{
    const real_t h = vehicle->step, speed = vehicle->state.wheel_speed[k];
    mesh->accel = choose(is_nan(mesh->speed), mesh->accel, (speed - mesh->speed) / h);

    const real_t inertia = rotor_inertia(vehicle, k, share);
    real_t damping;
    const real_t torque = push(vehicle, k, inertia, mesh->accel, &damping);
    const real_t before = mesh->slip;
    mesh->slip += h * torque / (inertia + h * damping);
    mesh->play += 0.5 * h * (before + mesh->slip);
    const mask_t meets = real_abs(mesh->play) > 0.5 * gap;
    mesh->play = choose(meets, real_signed(0.5 * gap, mesh->play), mesh->play);
    mesh->slip = choose(meets, real_of(0), mesh->slip);
    const mask_t impact = before != 0;
    mesh->speed = choose(meets & impact, real_of(NAN), speed);
    vehicle->wheel_torque[k] -= inertia * (mesh->slip - before) / h;
}

static void wheel(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    mesh_t *mesh = (mesh_t *)memory;
    for (int k = 0; k < vehicle_wheels(vehicle); k++)
        turn(&mesh[k], vehicle, k, value[0], value[1]);
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "gap",
     .role = BP_ROLE_SIZE,
     .unit = "rad",
     .linear_unit = "m",
     .meaning = "play between motor and wheel, at the wheel",
     .minimum = 0,
     .maximum = 3,
     .preset = 0.2,
     .scan_from = 0.01,
     .scan_to = 0.5,
     .scan_count = 16},
    {.name = "rotor_share",
     .role = BP_ROLE_SHAPE,
     .unit = "1",
     .meaning = "share of wheel_inertia that turns before the play; where the input commands force, share of the mass",
     .minimum = 0.01,
     .maximum = 0.9,
     .preset = 0.6},
};

const effect_t effect_gear_backlash = {
    .info = {.name = "gear_backlash",
             .words = "play in the gears",
             .summary = "The motor turns freely through a small angle before it moves the wheel the other way.",
             .mechanism = "gear",
             .acts_on = "gear",
             .equation = "within |p| < gap / 2 the rotor turns alone: J_m w_m' = K_t i, p' = w_m - w, J_m = "
                         "rotor_share J; at either end it meets the wheel without rebound, and leaves when the torque "
                         "changes sign",
             .source = "Nordin & Gutman 2002, Controlling mechanical systems with backlash, a survey; two inertias, "
                       "inelastic impact",
             .prior = BP_PRIOR_COMMON,
             .prior_reason = "Every cheap gear train needs clearance between its teeth.",
             .advice =
                 "Feel for play between motor and wheel: set the gears closer, or fix what is loose on its shaft.",
             .parameter_count = 2,
             .parameters = PARAMETERS,
             .motor_step = 0.001},
    .memory_count = 2 * sizeof(mesh_t) / sizeof(real_t),
    .hook = {[SITE_START] = start, [SITE_DRIVE] = drive, [SITE_WHEEL] = wheel},
};
