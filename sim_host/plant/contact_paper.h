/* contact_paper.h: the contact of the paper profile. The wheels turn alone (eq. 14); eq. 15 to 17 push the body (eq. 1
 * to 9). */
#ifndef BRICKPILOT_PLANT_CONTACT_PAPER_H
#define BRICKPILOT_PLANT_CONTACT_PAPER_H

#include "plant/body.h"
#include "plant/contact.h"

/* Speed in m/s below which the direction of motion has no meaning: the thrust of eq. 6 and 7 points forward, as at
 * rest. */
static const double REST_SPEED = 3.5e-4;

static inline void paper_prepare(wheels_t *wheels, const vehicle_t *vehicle)
{
    wheels->inertia = (pair_t){.left = vehicle->motor[0].inertia, .right = vehicle->motor[1].inertia};
    wheels->drag = (pair_t){.left = vehicle->motor[0].drag, .right = vehicle->motor[1].drag};
    wheels->load[0] = real_of(0);
    wheels->load[1] = real_of(0);
    wheels->dry_arm[DRY_LEFT] = real_of(1);
    wheels->dry_arm[DRY_RIGHT] = real_of(1);
    wheels->dry_arm[DRY_SURGE] = real_of(0);
    wheels->dry_arm[DRY_YAW] = real_of(0);
}

/* Eq. 15 to 17: a second torque law in addition to that of eq. 14 (fault 1). A floating motor has no thrust. */
static inline real_t paper_thrust(const vehicle_t *vehicle, int side, real_t speed)
{
    const real_t *p = vehicle->parameter;
    const real_t voltage = vehicle->voltage[side];
    const real_t most = voltage / p[PARAMETER_BATTERY_VOLTAGE] * p[PARAMETER_STALL_TORQUE];
    const real_t force = (most - p[PARAMETER_STALL_TORQUE] / p[PARAMETER_NO_LOAD_SPEED] * speed) /
                         (p[PARAMETER_WHEEL_RADIUS] * vehicle->build.rim[side]);
    return choose(is_nan(voltage), real_of(0), force);
}

typedef struct {
    real_t surge, sway, yaw;
} paper_rates_t;

/* Eq. 2 to 9. The thrust follows the velocity, not the heading (fault 3), and nothing damps the yaw rate (fault 4). The
 * forces act at the middle of the axle; the state is that of the centre of mass. */
static inline paper_rates_t paper_rates(const vehicle_t *vehicle, real_t u, real_t v, real_t r,
                                        const real_t wheel_speed[2])
{
    const real_t *p = vehicle->parameter;
    const build_t *build = &vehicle->build;
    const real_t left = paper_thrust(vehicle, 0, wheel_speed[0]);
    const real_t right = paper_thrust(vehicle, 1, wheel_speed[1]);
    const real_t speed = real_root(u * u + v * v);
    const mask_t moves = speed >= REST_SPEED;
    const real_t sin_beta = choose(moves, v / speed, real_of(0));
    const real_t cos_beta = choose(moves, real_abs(u) / speed, real_of(1));

    const real_t surge_force = (left + right) * cos_beta - vehicle->drag_surge * u + vehicle->force_surge;
    const real_t sway_force = (left + right) * sin_beta - vehicle->drag_sway * v + vehicle->force_sway;
    const real_t offset = surge_force * build->com_right - sway_force * build->com_forward;
    const real_t moment = (left - right) * p[PARAMETER_HALF_TRACK] - vehicle->drag_yaw * r + vehicle->moment_yaw;
    return (paper_rates_t){.surge = surge_force / build->mass + v * r,
                           .sway = sway_force / build->mass - u * r,
                           .yaw = (moment + offset) / build->yaw_inertia};
}

/* Limits the drags to half of the stability limit of Heun's method. */
static inline void paper_limit_drags(vehicle_t *vehicle, double step)
{
    vehicle->drag_surge = real_least(vehicle->drag_surge, vehicle->build.mass / step);
    vehicle->drag_sway = real_least(vehicle->drag_sway, vehicle->build.mass / step);
    vehicle->drag_yaw = real_least(vehicle->drag_yaw, vehicle->build.yaw_inertia / step);
}

/* Returns the speed after dry friction has changed it by at most `most`; 0 if this can stop the motion. */
static inline real_t paper_rub(real_t speed, real_t most)
{
    return choose(real_abs(speed) > most, speed - real_signed(most, speed), real_of(0));
}

static inline void paper_finish(const wheels_t *wheels, vehicle_t *vehicle, const state_t *before, double step)
{
    (void)wheels;
    state_t *state = &vehicle->state;
    paper_limit_drags(vehicle, step);
    const real_t u = before->surge, v = before->sway, r = before->yaw_rate;
    const paper_rates_t first = paper_rates(vehicle, u, v, r, before->wheel_speed);
    const paper_rates_t second =
        paper_rates(vehicle, u + step * first.surge, v + step * first.sway, r + step * first.yaw, state->wheel_speed);

    state->surge = u + 0.5 * step * (first.surge + second.surge);
    state->sway = v + 0.5 * step * (first.sway + second.sway);
    state->yaw_rate = r + 0.5 * step * (first.yaw + second.yaw);
    const real_t *dry = vehicle->dry;
    const real_t surge = paper_rub(state->surge, step * dry[DRY_SURGE] / vehicle->build.mass);
    const real_t yaw_rate = paper_rub(state->yaw_rate, step * dry[DRY_YAW] / vehicle->build.yaw_inertia);
    state->surge = choose(dry[DRY_SURGE] > 0, surge, state->surge);
    state->yaw_rate = choose(dry[DRY_YAW] > 0, yaw_rate, state->yaw_rate);
    body_accelerations(vehicle, before, step);
    body_move(state, 0.5 * step * (u + state->surge), 0.5 * step * (v + state->sway),
              0.5 * step * (r + state->yaw_rate));
}

static const contact_t contact_paper = {.prepare = paper_prepare, .finish = paper_finish};

#endif
