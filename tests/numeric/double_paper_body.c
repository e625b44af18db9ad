#include "double_paper_body.h"

#include <math.h>

#include "models/rcx_gen.h"

enum { MOTOR_STEPS = 100 };
static const double PERIOD_S = 0.003, TURN = 6.28318530717958647692, REST_SPEED = 0.35e-3;

typedef struct {
    double current, speed; /* or their rates of change */
} motor_pair_t;

/* Eq. 12 to 14. */
static motor_pair_t motor_rates(motor_pair_t now, double voltage)
{
    const double loss =
        RCX_VISCOUS_FRICTION + RCX_MASS * RCX_GRAVITY * RCX_ROLLING_FRICTION * RCX_WHEEL_RADIUS * RCX_WHEEL_RADIUS;
    return (motor_pair_t){(voltage - RCX_RESISTANCE * now.current - RCX_EMF_CONSTANT * now.speed) / RCX_INDUCTANCE,
                          (RCX_TORQUE_CONSTANT * now.current - loss * now.speed) / RCX_WHEEL_INERTIA};
}

static motor_pair_t after(motor_pair_t now, motor_pair_t rates, double step)
{
    return (motor_pair_t){now.current + step * rates.current, now.speed + step * rates.speed};
}

/* Turns one wheel on; returns its thrust by eq. 15 to 17 with the mean of its speed. */
static double wheel_thrust(bp_state *state, int side, double voltage)
{
    const double step = PERIOD_S / MOTOR_STEPS;
    motor_pair_t wheel = {state->current[side], state->wheel_speed[side]};
    for (int i = 0; i < MOTOR_STEPS; i++)
        wheel = after(wheel, motor_rates(after(wheel, motor_rates(wheel, voltage), step / 2), voltage), step);
    const double mean = (state->wheel_speed[side] + wheel.speed) / 2;
    state->current[side] = wheel.current;
    state->wheel_speed[side] = wheel.speed;
    return RCX_STALL_TORQUE * (voltage / RCX_BATTERY_VOLTAGE - mean / RCX_NO_LOAD_SPEED) / RCX_WHEEL_RADIUS;
}

/* Eq. 6, 7 and 9 seen from the room; backward, the velocity's mirror image ahead. */
static double thrust_direction(const double_paper_body_t *body, double heading)
{
    const double course = atan2(body->velocity[1], body->velocity[0]);
    if (hypot(body->state.surge, body->state.sway) < REST_SPEED)
        return heading;
    return fabs(remainder(course - heading, TURN)) <= TURN / 4 ? course : 2 * heading + TURN / 2 - course;
}

/* Change of speed by air drag in a step, eq. 5. */
static double drag(double speed)
{
    return -PERIOD_S * 0.5 * RCX_AIR_DENSITY * RCX_DRAG_AREA / RCX_MASS * speed * fabs(speed);
}

void double_paper_body_step(double_paper_body_t *body, const double voltage[2])
{
    bp_state *state = &body->state;
    const double left = wheel_thrust(state, 0, voltage[0]), right = wheel_thrust(state, 1, voltage[1]);
    const double push = PERIOD_S * (left + right) / RCX_MASS;
    const double turn = PERIOD_S * (left - right) * RCX_HALF_TRACK / RCX_YAW_INERTIA;
    const double turned = PERIOD_S * (state->yaw_rate + turn / 2), before = state->heading;
    const double along = thrust_direction(body, before + turned / 2);
    const double drag_surge = drag(state->surge), drag_sway = drag(state->sway);
    const double change_x = push * cos(along) + drag_surge * cos(before) - drag_sway * sin(before);
    const double change_y = push * sin(along) + drag_surge * sin(before) + drag_sway * cos(before);

    state->yaw_rate += turn;
    state->heading += turned;
    state->x += PERIOD_S * (body->velocity[0] + change_x / 2);
    state->y += PERIOD_S * (body->velocity[1] + change_y / 2);
    body->velocity[0] += change_x;
    body->velocity[1] += change_y;
    state->surge = body->velocity[0] * cos(state->heading) + body->velocity[1] * sin(state->heading);
    state->sway = body->velocity[1] * cos(state->heading) - body->velocity[0] * sin(state->heading);
}
