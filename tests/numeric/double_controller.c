#include "double_controller.h"

#include <math.h>

#include "models/rcx_gen.h"

static const double TURN = 6.28318530717958647692;

typedef struct {
    double surge, yaw; /* V */
} effort_t;

typedef struct {
    bool drive;
    double speed, heading;
} demand_t;

typedef struct {
    double kp, ki, kd, limit;
} gains_t;

typedef struct {
    double x, y, distance, bearing; /* of the waypoint, from the robot, in the axes of the arena */
} sight_t;

static double clamp(double value, double limit)
{
    return fmax(-limit, fmin(limit, value));
}

static double wrapped(double angle)
{
    return remainder(angle, TURN);
}

/* Eq. 22. */
static sight_t look(const double_route_t *route, const double_controller_t *state, const bp_state *truth)
{
    const double x = route->waypoints[2 * state->waypoint] - truth->x;
    const double y = route->waypoints[2 * state->waypoint + 1] - truth->y;
    return (sight_t){x, y, hypot(x, y), atan2(y, x)};
}

static void enter(double_controller_t *state, double_phase_t phase, const sight_t *sight, const bp_state *truth)
{
    state->phase = phase;
    state->quiet_time = 0;
    if (phase == DOUBLE_BRAKE)
        state->hold_heading = truth->heading;
    if (phase == DOUBLE_DRIVE) {
        state->pass_bearing = sight->bearing;
        state->passing = true;
    }
}

static bool points_away(const double_constants_t *constants, const double_controller_t *state, const bp_state *truth)
{
    return fabs(wrapped(state->bearing - truth->heading)) > constants->pivot;
}

static void begin_leg(const double_constants_t *constants, const double_route_t *route, double_controller_t *state,
                      const bp_state *truth)
{
    const sight_t sight = look(route, state, truth);
    state->leg_time = 0;
    state->leg_overshoots = 0;
    state->passing = false;
    state->bearing = sight.bearing;
    enter(state, points_away(constants, state, truth) ? DOUBLE_BRAKE : DOUBLE_DRIVE, &sight, truth);
}

static void reach(const double_constants_t *constants, const double_route_t *route, double_controller_t *state,
                  const sight_t *sight, const bp_state *truth)
{
    if (state->waypoint + 1 == route->count) {
        state->last_reached = true;
        enter(state, DOUBLE_BRAKE, sight, truth);
    } else {
        state->waypoint++;
        begin_leg(constants, route, state, truth);
    }
}

static void fail(const double_constants_t *constants, const double_route_t *route, double_controller_t *state,
                 const bp_state *truth)
{
    if (constants->skip_failed == 0 || state->waypoint + 1 == route->count) {
        state->mode = DOUBLE_FAULT;
        return;
    }
    state->skipped++;
    state->waypoint++;
    begin_leg(constants, route, state, truth);
}

/* The overshoot rule: past the plane through the waypoint, normal to the bearing at which DRIVE began. */
static bool overshoots(const double_constants_t *constants, double_controller_t *state, const sight_t *sight,
                       const bp_state *truth)
{
    const double ahead = sight->x * cos(state->pass_bearing) + sight->y * sin(state->pass_bearing);
    if (!state->passing || ahead >= -constants->overshoot)
        return false;
    state->passing = false;
    state->leg_overshoots++;
    if (state->phase == DOUBLE_DRIVE)
        enter(state, DOUBLE_BRAKE, sight, truth);
    return true;
}

/* Half a period of slack: sums of periods are rounded. */
static bool quiet_for(double_controller_t *state, bool quiet, double period, double needed)
{
    state->quiet_time = quiet ? state->quiet_time + period : 0;
    return quiet && state->quiet_time > needed - period / 2;
}

static void move(const double_constants_t *constants, double_controller_t *state, const sight_t *sight,
                 const bp_state *truth, double period)
{
    if (state->phase == DOUBLE_BRAKE || sight->distance > constants->bearing_hold)
        state->bearing = sight->bearing;
    if (state->phase == DOUBLE_BRAKE) {
        const bool rests = fabs(truth->surge) <= constants->rest_speed;
        if (!quiet_for(state, rests, period, constants->rest_time))
            return;
        if (state->last_reached)
            state->mode = DOUBLE_ARRIVED;
        else
            enter(state, DOUBLE_TURN, sight, truth);
    } else if (state->phase == DOUBLE_TURN) {
        const bool settled = fabs(wrapped(state->bearing - truth->heading)) <= constants->align &&
                             fabs(truth->yaw_rate) <= constants->rest_yaw_rate;
        if (quiet_for(state, settled, period, constants->settle_time))
            enter(state, DOUBLE_DRIVE, sight, truth);
    } else if (points_away(constants, state, truth)) {
        enter(state, DOUBLE_BRAKE, sight, truth);
    }
}

static void guide(const double_constants_t *constants, const double_route_t *route, double_controller_t *state,
                  const bp_state *truth, double period)
{
    const sight_t sight = look(route, state, truth);
    state->leg_time += period;
    if (state->leg_time > constants->leg_timeout + period / 2)
        fail(constants, route, state, truth);
    else if (!state->last_reached && sight.distance <= constants->acceptance)
        reach(constants, route, state, &sight, truth);
    else if (!state->last_reached && overshoots(constants, state, &sight, truth) &&
             state->leg_overshoots > constants->max_overshoots)
        fail(constants, route, state, truth);
    else
        move(constants, state, &sight, truth, period);
}

static demand_t demanded(const double_constants_t *constants, const double_route_t *route,
                         const double_controller_t *state, const bp_state *truth)
{
    const double braking = sqrt(2 * constants->decel * look(route, state, truth).distance);
    const double approach = fmin(constants->cruise, fmax(constants->creep, braking));
    return (demand_t){.drive = state->mode == DOUBLE_RUN,
                      .speed = state->phase == DOUBLE_DRIVE ? approach : 0,
                      .heading = state->phase == DOUBLE_BRAKE ? state->hold_heading : state->bearing};
}

/* Eq. 21, derivative on the measurement; the integrator is held in the direction that meets a limit. */
static double pid(const gains_t *gains, double_pid_t *state, double error, double rate, double feedforward,
                  double period)
{
    const double wanted = feedforward + gains->kp * error + state->integral - gains->kd * rate;
    const double given = clamp(wanted, gains->limit);
    const double change = gains->ki * error * period;
    const bool above = wanted > given || state->saturated > 0, below = wanted < given || state->saturated < 0;
    if (!(above && change > 0) && !(below && change < 0))
        state->integral = clamp(state->integral + change, gains->limit);
    return given;
}

/* Voltage per speed that both motors need on level ground: back EMF, and the current that makes up for eq. 13 and 14.
 */
static double holding_voltage(void)
{
    const double loss =
        RCX_VISCOUS_FRICTION + RCX_MASS * RCX_GRAVITY * RCX_ROLLING_FRICTION * RCX_WHEEL_RADIUS * RCX_WHEEL_RADIUS;
    return (RCX_EMF_CONSTANT + RCX_RESISTANCE * loss / RCX_TORQUE_CONSTANT) / RCX_WHEEL_RADIUS;
}

static effort_t control(const double_constants_t *c, double_controller_t *state, const demand_t *demand,
                        const bp_state *truth, double period)
{
    const gains_t speed = {c->speed_kp, c->speed_ki, c->speed_kd, c->speed_limit};
    const gains_t heading = {c->heading_kp, c->heading_ki, c->heading_kd, c->heading_limit};
    const double feedforward = c->feedforward_share * holding_voltage() * demand->speed;
    const double heading_error = wrapped(demand->heading - truth->heading);
    if (!demand->drive) {
        state->speed.integral = state->heading.integral = 0;
        return (effort_t){0, 0};
    }
    return (effort_t){pid(&speed, &state->speed, demand->speed - truth->surge, state->accel, feedforward, period),
                      pid(&heading, &state->heading, heading_error, truth->yaw_rate, 0, period)};
}

/* Yaw gets what voltage there is, surge what is left. */
static void mix(const double_constants_t *constants, double_controller_t *state, const effort_t *effort, double battery,
                double voltage[2])
{
    const double available = fmax(battery, constants->battery_floor) * constants->max_duty;
    const double yaw = clamp(effort->yaw, available);
    const double surge = clamp(effort->surge, available - fabs(yaw));
    state->heading.saturated = (effort->yaw > yaw) - (effort->yaw < yaw);
    state->speed.saturated = (effort->surge > surge) - (effort->surge < surge);
    voltage[0] = surge + yaw;
    voltage[1] = surge - yaw;
}

void double_controller_start(const double_constants_t *constants, const double_route_t *route,
                             double_controller_t *state, const bp_state *truth)
{
    state->mode = DOUBLE_RUN;
    state->waypoint = 0;
    state->last_reached = false;
    state->skipped = 0;
    begin_leg(constants, route, state, truth);
}

void double_controller_step(const double_constants_t *constants, const double_route_t *route,
                            double_controller_t *state, const bp_state *truth, double battery, double period,
                            double voltage[2])
{
    const double share = 1 - exp(-period / constants->accel_filter_time);
    state->accel += share * ((truth->surge - state->speed_before) / period - state->accel);
    state->speed_before = truth->surge;

    if (state->mode == DOUBLE_RUN)
        guide(constants, route, state, truth, period);
    const demand_t demand = demanded(constants, route, state, truth);
    const effort_t effort = control(constants, state, &demand, truth, period);
    mix(constants, state, &effort, battery, voltage);
}
