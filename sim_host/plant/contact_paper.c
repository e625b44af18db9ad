#include <math.h>

#include "plant/body.h"
#include "plant/contact.h"

/* m/s. Below this speed the direction of motion has no meaning, and the thrust of eq. 6 and 7 points forward as at
 * rest. */
static const double REST_SPEED = 3.5e-4;

static void prepare(wheels_t *wheels, const vehicle_t *vehicle)
{
    wheels->inertia = (pair_t){vehicle->motor[0].inertia, vehicle->motor[1].inertia, 0};
    wheels->drag = (pair_t){vehicle->motor[0].drag, vehicle->motor[1].drag, 0};
    wheels->load[0] = 0;
    wheels->load[1] = 0;
    wheels->dry_arm[DRY_LEFT] = 1;
    wheels->dry_arm[DRY_RIGHT] = 1;
    wheels->dry_arm[DRY_SURGE] = 0;
    wheels->dry_arm[DRY_YAW] = 0;
}

/* Eq. 15 to 17: a second torque law beside that of eq. 14 (fault 1). A floating motor has no thrust. */
static double thrust(const vehicle_t *vehicle, int side, double speed)
{
    const double *p = vehicle->parameter;
    const double voltage = vehicle->voltage[side];
    if (isnan(voltage))
        return 0;
    const double most = voltage / p[PARAMETER_BATTERY_VOLTAGE] * p[PARAMETER_STALL_TORQUE];
    return (most - p[PARAMETER_STALL_TORQUE] / p[PARAMETER_NO_LOAD_SPEED] * speed) /
           (p[PARAMETER_WHEEL_RADIUS] * vehicle->build.rim[side]);
}

typedef struct {
    double surge, sway, yaw;
} rates_t;

/* Eq. 2 to 9. The thrust follows the velocity, not the heading (fault 3), and nothing damps the yaw rate (fault 4). The
 * forces act at the middle of the axle; the state is that of the centre of mass. */
static rates_t rates(const vehicle_t *vehicle, double u, double v, double r, const double wheel_speed[2])
{
    const double *p = vehicle->parameter;
    const build_t *build = &vehicle->build;
    const double left = thrust(vehicle, 0, wheel_speed[0]);
    const double right = thrust(vehicle, 1, wheel_speed[1]);
    const double speed = sqrt(u * u + v * v);
    const bool moves = speed >= REST_SPEED;
    const double sin_beta = moves ? v / speed : 0;
    const double cos_beta = moves ? fabs(u) / speed : 1;

    const double surge_force = (left + right) * cos_beta - vehicle->drag_surge * u + vehicle->force_surge;
    const double sway_force = (left + right) * sin_beta - vehicle->drag_sway * v + vehicle->force_sway;
    const double offset = surge_force * build->com_right - sway_force * build->com_forward;
    const double moment = (left - right) * p[PARAMETER_HALF_TRACK] - vehicle->drag_yaw * r + vehicle->moment_yaw;
    return (rates_t){.surge = surge_force / build->mass + v * r,
                     .sway = sway_force / build->mass - u * r,
                     .yaw = (moment + offset) / build->yaw_inertia};
}

/* Limits the drags to half of what Heun's method is stable for. */
static void limit_drags(vehicle_t *vehicle, double step)
{
    vehicle->drag_surge = fmin(vehicle->drag_surge, vehicle->build.mass / step);
    vehicle->drag_sway = fmin(vehicle->drag_sway, vehicle->build.mass / step);
    vehicle->drag_yaw = fmin(vehicle->drag_yaw, vehicle->build.yaw_inertia / step);
}

/* The speed after the impulse of dry friction, which stops what it can hold. */
static double rub(double speed, double most)
{
    return fabs(speed) > most ? speed - copysign(most, speed) : 0;
}

static void finish(const wheels_t *wheels, vehicle_t *vehicle, const bp_state *before, double step)
{
    (void)wheels;
    bp_state *state = &vehicle->state;
    limit_drags(vehicle, step);
    const double u = before->surge, v = before->sway, r = before->yaw_rate;
    const rates_t first = rates(vehicle, u, v, r, before->wheel_speed);
    const rates_t second =
        rates(vehicle, u + step * first.surge, v + step * first.sway, r + step * first.yaw, state->wheel_speed);

    state->surge = u + 0.5 * step * (first.surge + second.surge);
    state->sway = v + 0.5 * step * (first.sway + second.sway);
    state->yaw_rate = r + 0.5 * step * (first.yaw + second.yaw);
    if (vehicle->dry[DRY_SURGE] > 0)
        state->surge = rub(state->surge, step * vehicle->dry[DRY_SURGE] / vehicle->build.mass);
    if (vehicle->dry[DRY_YAW] > 0)
        state->yaw_rate = rub(state->yaw_rate, step * vehicle->dry[DRY_YAW] / vehicle->build.yaw_inertia);
    body_accelerations(vehicle, before, step);
    body_move(state, 0.5 * step * (u + state->surge), 0.5 * step * (v + state->sway),
              0.5 * step * (r + state->yaw_rate));
}

const contact_t contact_paper = {.prepare = prepare, .finish = finish};
