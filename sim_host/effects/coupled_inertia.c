#include "effects/effect.h"

/* Least number of motor steps in a period of free oscillation: with fewer steps the integration would ring. */
static const double STEPS_OF_PERIOD = 12;

static const double FULL_TURN = 6.283185307179586; /* rad */

typedef struct {
    real_t speed; /* rad/s of the second inertia */
    real_t twist; /* angle by which it is ahead of the wheel, rad */
    real_t step;  /* s: the motor step over which `twist` has not been integrated yet */
} second_t;

/* Spring and damper, divided by the second inertia. So the second inertia may be 0: the wheel then does not feel it. */
typedef struct {
    real_t inertia;   /* kg m^2, or kg */
    real_t stiffness; /* 1/s^2 */
    real_t damping;   /* 1/s */
} coupling_t;

static void start(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    (void)value;
    second_t *second = (second_t *)memory;
    for (int k = 0; k < 2; k++)
        second[k].speed = vehicle->state.wheel_speed[k];
}

/* Metres per rad at the wheel; 1 if the motor's input commands a force. */
static real_t metres_per_rad(const vehicle_t *vehicle)
{
    const mask_t linear = vehicle->parameter[PARAMETER_FORCE_PER_VOLT] > 0;
    return choose(linear, real_of(1), vehicle->parameter[PARAMETER_WHEEL_RADIUS]);
}

static coupling_t coupling(const real_t *value, const vehicle_t *vehicle, int k)
{
    const real_t arm = metres_per_rad(vehicle);
    const real_t first = vehicle->motor[k].inertia + vehicle->build.mass * arm * arm / vehicle_wheels(vehicle);
    const real_t rate = FULL_TURN / real_most(value[0], STEPS_OF_PERIOD * vehicle->step);
    return (coupling_t){.inertia = value[1] * first,
                        .stiffness = rate * rate / (1 + value[1]),
                        .damping = 2 * value[2] * rate / (1 + value[1])};
}

/* Returns the speed of the second inertia minus the speed of the wheel, which has just done its step. */
static real_t catch_up(second_t *second, real_t wheel_speed)
{
    const real_t ahead = second->speed - wheel_speed;
    second->twist += second->step * ahead;
    second->step = real_of(0);
    return ahead;
}

/* The wheel feels the torque that the second inertia takes, so no momentum is lost. */
static void wheel(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    second_t *second = (second_t *)memory;
    const real_t h = vehicle->step;
    for (int k = 0; k < vehicle_wheels(vehicle); k++) {
        const coupling_t spring = coupling(value, vehicle, k);
        const real_t ahead = catch_up(&second[k], vehicle->state.wheel_speed[k]);
        const real_t back = spring.stiffness * second[k].twist + spring.damping * ahead;
        const real_t change = -h * back / (1 + h * spring.damping);
        second[k].speed += change;
        second[k].step = h;
        vehicle->wheel_torque[k] -= spring.inertia * change / h;
    }
}

/* Moves the readings of a wheel or a motor to the second inertia if the sensor is mounted there. */
static void read_second(const real_t *value, vehicle_t *vehicle, second_t *second, int k)
{
    const bool motor = vehicle->vehicle == BP_MOTOR;
    const real_t sensed = value[3], metres = metres_per_rad(vehicle);
    const real_t speed = sensed * catch_up(second, vehicle->state.wheel_speed[k]), angle = sensed * second->twist;
    vehicle->output[motor ? OUTPUT_SPEED : OUTPUT_WHEEL_SPEED_LEFT + k] += speed;
    vehicle->output[motor ? OUTPUT_ANGLE : OUTPUT_WHEEL_ANGLE_LEFT + k] += angle;
    vehicle->output[motor ? OUTPUT_VELOCITY : OUTPUT_WHEEL_VELOCITY_LEFT + k] += metres * speed;
    vehicle->output[motor ? OUTPUT_POSITION : OUTPUT_WHEEL_TRAVEL_LEFT + k] += metres * angle;
}

static void sensor(const real_t *value, real_t *memory, vehicle_t *vehicle)
{
    for (int k = 0; k < vehicle_wheels(vehicle); k++)
        read_second(value, vehicle, &((second_t *)memory)[k], k);
}

static const bp_parameter_info PARAMETERS[] = {
    {.name = "period",
     .role = BP_ROLE_SIZE,
     .unit = "s",
     .meaning = "time of one free oscillation of the two inertias against each other; at least 12 motor steps",
     .minimum = 0,
     .maximum = 10,
     .preset = 0.3,
     .scan_from = 0.03,
     .scan_to = 1.5,
     .scan_count = 12},
    {.name = "share",
     .role = BP_ROLE_SHAPE,
     .unit = "1",
     .meaning = "second inertia over the inertia that the wheel turns as the vehicle drives straight ahead",
     .minimum = 0,
     .maximum = 50,
     .preset = 0.5},
    {.name = "damping",
     .role = BP_ROLE_SHAPE,
     .unit = "1",
     .meaning = "damping ratio of that oscillation",
     .minimum = 0,
     .maximum = 2,
     .preset = 0.1},
    {.name = "sensed",
     .role = BP_ROLE_SWITCH,
     .unit = "1",
     .meaning = "1: the rotation sensor sits on the second inertia; 0: on the wheel or motor",
     .minimum = 0,
     .maximum = 1,
     .preset = 0},
};

const effect_t effect_coupled_inertia = {
    .info =
        {.name = "coupled_inertia",
         .words = "a second inertia behind a spring",
         .summary = "A belt, a shaft or a soft mount lets a second inertia swing against the wheel or the motor.",
         .mechanism = "gear",
         .acts_on = "gear",
         .equation =
             "J_2 w_2' = -T, p' = w_2 - w, T = k p + c (w_2 - w) drives the wheel; J_2 = share J, J = wheel_inertia "
             "+ mass r_w^2 / wheels, k = J_r (2 pi / period)^2, c = 2 damping J_r 2 pi / period, J_r = J J_2 / (J + "
             "J_2); the rotation sensor reads w + sensed (w_2 - w)",
         .source = "two masses and a flexible coupling, Ellis & Lorenz 2000, Resonant load control methods for "
                   "industrial servo drives; Wigren & Schoukens 2017, coupled electric drives",
         .prior = BP_PRIOR_RARE,
         .prior_reason = "Wheels of small robots sit firmly on the motor's shaft or gear.",
         .advice = "Tighten the belt, the shaft's coupling or the mount: something swings on a spring.",
         .parameter_count = 4,
         .parameters = PARAMETERS,
         .motor_step = 0.001},
    .memory_count = 2 * sizeof(second_t) / sizeof(real_t),
    .hook = {[SITE_START] = start, [SITE_WHEEL] = wheel, [SITE_SENSOR] = sensor},
};
