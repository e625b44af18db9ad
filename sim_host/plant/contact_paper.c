#include <math.h>

#include "plant/body.h"
#include "plant/contact.h"

/* m/s. Below it the direction of motion has no meaning, and the thrust of eq. 6 and 7 points forward as at rest. */
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

/* Eq. 15 to 17: a second torque law, beside that of eq. 14 (fault 1). A floating motor gives none. */
static double thrust(const vehicle_t *vehicle, double voltage, double speed)
{
    const double *p = vehicle->parameter;
    if (isnan(voltage))
        return 0;
    const double most = voltage / p[PARAMETER_BATTERY_VOLTAGE] * p[PARAMETER_STALL_TORQUE];
    return (most - p[PARAMETER_STALL_TORQUE] / p[PARAMETER_NO_LOAD_SPEED] * speed) / p[PARAMETER_WHEEL_RADIUS];
}

typedef struct {
    double surge, sway, yaw;
} rates_t;

/* Eq. 2 to 9. The thrust follows the velocity, not the heading (fault 3); nothing damps the yaw rate (fault 4). */
static rates_t rates(const vehicle_t *vehicle, double u, double v, double r, const double wheel_speed[2])
{
    const double *p = vehicle->parameter;
    const double left = thrust(vehicle, vehicle->voltage[0], wheel_speed[0]);
    const double right = thrust(vehicle, vehicle->voltage[1], wheel_speed[1]);
    const double speed = sqrt(u * u + v * v);
    const bool moves = speed >= REST_SPEED;
    const double sin_beta = moves ? v / speed : 0;
    const double cos_beta = moves ? fabs(u) / speed : 1;

    const double surge_force = (left + right) * cos_beta - vehicle->drag_surge * u + vehicle->force_surge;
    const double sway_force = (left + right) * sin_beta - vehicle->drag_sway * v + vehicle->force_sway;
    const double moment = (left - right) * p[PARAMETER_HALF_TRACK] - vehicle->drag_yaw * r + vehicle->moment_yaw;
    return (rates_t){.surge = surge_force / p[PARAMETER_MASS] + v * r,
                     .sway = sway_force / p[PARAMETER_MASS] - u * r,
                     .yaw = moment / p[PARAMETER_YAW_INERTIA]};
}

static void finish(vehicle_t *vehicle, const bp_state *before, double step)
{
    bp_state *state = &vehicle->state;
    const double u = before->surge, v = before->sway, r = before->yaw_rate;
    const rates_t first = rates(vehicle, u, v, r, before->wheel_speed);
    const rates_t second =
        rates(vehicle, u + step * first.surge, v + step * first.sway, r + step * first.yaw, state->wheel_speed);

    state->surge = u + 0.5 * step * (first.surge + second.surge);
    state->sway = v + 0.5 * step * (first.sway + second.sway);
    state->yaw_rate = r + 0.5 * step * (first.yaw + second.yaw);
    body_accelerations(vehicle, before, step);
    body_move(state, 0.5 * step * (u + state->surge), 0.5 * step * (v + state->sway),
              0.5 * step * (r + state->yaw_rate));
}

const contact_t contact_paper = {prepare, finish};
