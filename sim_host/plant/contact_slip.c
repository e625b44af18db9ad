#include <math.h>

#include "plant/body.h"
#include "plant/contact.h"

/* A step is repeated if the ratio of a tyre's force to its limit is above this. */
static const double OVERLOAD = 1.05;

static pair_t add(pair_t a, pair_t b)
{
    return (pair_t){a.left + b.left, a.right + b.right, a.cross + b.cross};
}

static pair_t invert(pair_t a)
{
    const double scale = 1 / (a.left * a.right - a.cross * a.cross);
    return (pair_t){.left = a.right * scale, .right = a.left * scale, .cross = -a.cross * scale};
}

/* Ratio of slip speed to force: `creep` for small forces. The ratio grows with the slip, so that the force stays within
 * the friction. */
static double compliance(const tyre_t *tyre, double load, double slip)
{
    const double beyond = slip / (tyre->friction * load);
    return sqrt(tyre->creep * tyre->creep + beyond * beyond);
}

/* The tyres' linearised law in a step. With `one_circle`, a wheel's slip along the track and its slip sideways share
 * one limit. */
typedef struct {
    double along[2]; /* m/(N s): slip speed per force of each wheel along the track */
    double side;     /* kg: side impulse of both wheels per common slip speed */
    double side_yaw; /* kg m: side impulse per yaw rate, and yaw impulse per sway, of contacts ahead and behind */
    double yaw;      /* kg m^2: yaw impulse of the contacts' side forces per yaw rate */
} hold_t;

/* Fraction of the load on one of two opposite contacts. The contact lies `arm` from the middle; the centre of mass lies
 * `offset` towards the contact. Neither contact lifts off. */
static double load_share(double offset, double arm)
{
    return 0.5 * fmin(fmax(1 + offset / arm, 0.05), 1.95);
}

/* The four contacts of a skid steer lie half a wheelbase ahead of and behind the middle, so that a turn drags them
 * sideways. The force on each contact is friction times its load, against its slip over the floor in any direction:
 * Coulomb's law at each wheel, as in Kozlowski & Pazderski 2004, Modeling and control of a 4-wheel skid-steering mobile
 * robot, Int. J. Appl. Math. Comput. Sci. 14, eq. 14 to 17. Their law treats each direction separately, and passes
 * through 0 by an arc tangent. The floor's resistance to a turn and the larger effective track (Mandow and others 2007,
 * Experimental kinematics for wheeled skid-steer mobile robots), follow. */
static hold_t hold_of_four(const vehicle_t *vehicle, const slip_t *slip, double h)
{
    const build_t *build = &vehicle->build;
    const double *p = vehicle->parameter;
    const double arm = 0.5 * p[PARAMETER_WHEELBASE], low = p[PARAMETER_SLIP_SPEED];
    const double most = h * build->along.friction * build->mass * p[PARAMETER_GRAVITY];
    hold_t hold = {.side = 0};
    for (int k = 0; k < 2; k++) {
        const double of_side = load_share((k == 0) ? -build->com_right : build->com_right, p[PARAMETER_HALF_TRACK]);
        double along = 0.0;
        for (int end = 0; end < 2; end++) {
            const double x = (end == 0) ? -arm : arm;
            const double sideways = slip->sway + (x * slip->yaw_rate);
            const double speed = sqrt((low * low) + (slip->along[k] * slip->along[k]) + (sideways * sideways));
            const double held = most * of_side * load_share(build->com_forward, x) / speed;
            along += held;
            hold.side += held;
            hold.side_yaw += x * held;
            hold.yaw += x * x * held;
        }
        hold.along[k] = along > 0 ? h / along : 0;
    }
    return hold;
}

static hold_t hold_of(const vehicle_t *vehicle, const slip_t *slip, double h)
{
    if (vehicle->vehicle == BP_SKID_STEER)
        return hold_of_four(vehicle, slip, h);
    const build_t *build = &vehicle->build;
    const double weight = build->mass * vehicle->parameter[PARAMETER_GRAVITY], sway = slip->sway;
    hold_t hold = {.side = 0};
    for (int k = 0; k < 2 && build->along.creep > 0 && weight > 0; k++) {
        const double speed =
            build->one_circle > 0 ? sqrt(slip->along[k] * slip->along[k] + sway * sway) : slip->along[k];
        hold.along[k] = compliance(&build->along, 0.5 * weight, speed);
        hold.side += build->one_circle > 0 ? h / hold.along[k] : 0;
    }
    if (build->across.creep > 0 && weight > 0 && !(build->one_circle > 0))
        hold.side = h / compliance(&build->across, weight, sway);
    return hold;
}

/* A step uses the force for the slip at the step's end; with the slip at its start, the method would be of first order.
 * The slip is extrapolated from its values at the starts of the last step and of this step. */
static void expect(wheels_t *wheels, const vehicle_t *vehicle)
{
    const bp_state *state = &vehicle->state;
    const double radius = vehicle->parameter[PARAMETER_WHEEL_RADIUS], b = vehicle->parameter[PARAMETER_HALF_TRACK];
    const double *rim = vehicle->build.rim;
    const slip_t now = {{radius * rim[0] * state->wheel_speed[0] - (state->surge + b * state->yaw_rate),
                         radius * rim[1] * state->wheel_speed[1] - (state->surge - b * state->yaw_rate)},
                        state->sway,
                        state->yaw_rate};
    const slip_t before = wheels->body.has_slip ? wheels->body.slip : now;
    wheels->body.slip = now;
    wheels->body.has_slip = true;
    wheels->body.ahead.along[0] = 2 * now.along[0] - before.along[0];
    wheels->body.ahead.along[1] = 2 * now.along[1] - before.along[1];
    wheels->body.ahead.sway = 2 * now.sway - before.sway;
    wheels->body.ahead.yaw_rate = 2 * now.yaw_rate - before.yaw_rate;
}

static void prepare(wheels_t *wheels, const vehicle_t *vehicle)
{
    const bool rolls = !(vehicle->build.along.creep > 0);
    const double radius = vehicle->parameter[PARAMETER_WHEEL_RADIUS];
    for (int k = 0; k < 2; k++)
        wheels->load[k] = 0;
    wheels->inertia = (pair_t){vehicle->motor[0].inertia, vehicle->motor[1].inertia, 0};
    wheels->drag = (pair_t){vehicle->motor[0].drag, vehicle->motor[1].drag, 0};
    wheels->dry_arm[DRY_LEFT] = 1;
    wheels->dry_arm[DRY_RIGHT] = 1;
    wheels->dry_arm[DRY_SURGE] = rolls ? 0.5 * radius : 0;
    wheels->dry_arm[DRY_YAW] = rolls ? 0.5 * radius / vehicle->parameter[PARAMETER_HALF_TRACK] : 0;
    wheels->body.travel_surge = 0;
    wheels->body.travel_sway = 0;
    wheels->body.turn = 0;
}

/* Impulses over h s on surge, sway and yaw about the middle of the axle, without those of the tyres. The velocity of
 * the centre of mass keeps its direction over ground, so it turns in the body's axes. This is exact and adds no
 * energy. */
typedef struct {
    double surge, sway, yaw;
} impulse_t;

static impulse_t impulse_of(const vehicle_t *vehicle, double h)
{
    const bp_state *state = &vehicle->state;
    const double a = vehicle->build.com_forward, c = vehicle->build.com_right, mass = vehicle->build.mass;
    const double u = state->surge - state->yaw_rate * c, v = state->sway + state->yaw_rate * a;
    const double cosine = cos(h * state->yaw_rate), sine = sin(h * state->yaw_rate);
    const double surge = mass * (u * cosine + v * sine - u), sway = mass * (v * cosine - u * sine - v);
    return (impulse_t){.surge = surge + h * (vehicle->force_surge - vehicle->drag_surge * state->surge),
                       .sway = sway + h * (vehicle->force_sway - vehicle->drag_sway * state->sway),
                       .yaw = a * sway - c * surge + h * (vehicle->moment_yaw - vehicle->drag_yaw * state->yaw_rate)};
}

/* Computes the body's motion without tyre force along the track: its mass as the wheels feel it, with the sway
 * eliminated, and the speeds that it would reach. */
static void free_body(wheels_t *wheels, const vehicle_t *vehicle, double h, const hold_t *hold)
{
    const bp_state *state = &vehicle->state;
    const build_t *build = &vehicle->build;
    const double a = build->com_forward, c = build->com_right, b = vehicle->parameter[PARAMETER_HALF_TRACK];
    impulse_t impulse = impulse_of(vehicle, h);
    double yaw_mass = build->yaw_inertia + build->mass * (a * a + c * c) + h * vehicle->drag_yaw + hold->yaw;

    wheels->body.sway_mass = 0;
    if (build->across.creep > 0) {
        const double lever = build->mass * a + hold->side_yaw;
        impulse.sway -= hold->side * state->sway + hold->side_yaw * state->yaw_rate;
        impulse.yaw -= hold->side_yaw * state->sway + hold->yaw * state->yaw_rate;
        wheels->body.sway_impulse = impulse.sway;
        wheels->body.sway_mass = build->mass + h * vehicle->drag_sway + hold->side;
        wheels->body.sway_lever = lever;
        yaw_mass -= lever * lever / wheels->body.sway_mass;
        impulse.yaw -= lever * impulse.sway / wheels->body.sway_mass;
    }
    wheels->body.mass = contact_at_wheels(build->mass + h * vehicle->drag_surge, yaw_mass, b);
    wheels->body.mass.left -= 0.5 * build->mass * c / b;
    wheels->body.mass.right += 0.5 * build->mass * c / b;
    wheels->body.inverse = invert(wheels->body.mass);

    const double left = 0.5 * (impulse.surge + impulse.yaw / b), right = 0.5 * (impulse.surge - impulse.yaw / b);
    const pair_t *inverse = &wheels->body.inverse;
    wheels->body.free[0] = state->surge + b * state->yaw_rate + inverse->left * left + inverse->cross * right;
    wheels->body.free[1] = state->surge - b * state->yaw_rate + inverse->right * right + inverse->cross * left;
}

/* With the compliance C of the tyres and the body's mass B, the impulse on the body is (C / h + 1 / B)^-1 times the
 * speed of the wheels minus that of the free body. This rule is implicit in the slip; for C = 0 it gives no slip. */
static void grip(wheels_t *wheels, vehicle_t *vehicle, double h)
{
    const bp_state *state = &vehicle->state;
    const build_t *build = &vehicle->build;
    const double radius = vehicle->parameter[PARAMETER_WHEEL_RADIUS];
    const double rim[2] = {radius * build->rim[0], radius * build->rim[1]};
    const hold_t hold = hold_of(vehicle, &wheels->body.ahead, h);
    free_body(wheels, vehicle, h, &hold);
    wheels->body.turned = hold.yaw;

    wheels->body.grip = wheels->body.mass;
    if (build->along.creep > 0) {
        const pair_t soft = {hold.along[0] / h, hold.along[1] / h, 0};
        wheels->body.soft[0] = soft.left;
        wheels->body.soft[1] = soft.right;
        const bool carries = build->mass * vehicle->parameter[PARAMETER_GRAVITY] > 0;
        wheels->body.grip = carries ? invert(add(soft, wheels->body.inverse)) : (pair_t){0, 0, 0};
    }
    const pair_t *grip_mass = &wheels->body.grip;
    wheels->inertia = (pair_t){.left = vehicle->motor[0].inertia + rim[0] * rim[0] * grip_mass->left,
                               .right = vehicle->motor[1].inertia + rim[1] * rim[1] * grip_mass->right,
                               .cross = rim[0] * rim[1] * grip_mass->cross};
    const double behind[2] = {wheels->body.free[0] - rim[0] * state->wheel_speed[0],
                              wheels->body.free[1] - rim[1] * state->wheel_speed[1]};
    wheels->load[0] = rim[0] * (grip_mass->left * behind[0] + grip_mass->cross * behind[1]) / h;
    wheels->load[1] = rim[1] * (grip_mass->right * behind[1] + grip_mass->cross * behind[0]) / h;
}

/* Computes the body's ground speeds with the tyres' impulses and the body's own dry friction. */
static void ground_speeds(const wheels_t *wheels, const vehicle_t *vehicle, double h, double ground[2])
{
    const double radius = vehicle->parameter[PARAMETER_WHEEL_RADIUS], b = vehicle->parameter[PARAMETER_HALF_TRACK];
    const double rim[2] = {radius * vehicle->build.rim[0] * vehicle->state.wheel_speed[0],
                           radius * vehicle->build.rim[1] * vehicle->state.wheel_speed[1]};
    if (!(vehicle->build.along.creep > 0)) {
        ground[0] = rim[0];
        ground[1] = rim[1];
        return;
    }
    const pair_t *inverse = &wheels->body.inverse, *grip_mass = &wheels->body.grip;
    const double ahead[2] = {rim[0] - wheels->body.free[0], rim[1] - wheels->body.free[1]};
    const double left = grip_mass->left * ahead[0] + grip_mass->cross * ahead[1];
    const double right = grip_mass->right * ahead[1] + grip_mass->cross * ahead[0];
    ground[0] = wheels->body.free[0] + inverse->left * left + inverse->cross * right;
    ground[1] = wheels->body.free[1] + inverse->right * right + inverse->cross * left;
    const double bound[DRY_COUNT] = {
        [DRY_SURGE] = 0.5 * h * vehicle->dry[DRY_SURGE], [DRY_YAW] = 0.5 * h / b * vehicle->dry[DRY_YAW]};
    if (bound[DRY_SURGE] + bound[DRY_YAW] > 0)
        dry_solve(ground, &wheels->body.mass, inverse, bound);
}

/* True if a turn drags contacts of a skid steer sideways and their assumed force was too large. Sets their slip. */
static bool drags(wheels_t *wheels, const vehicle_t *vehicle, double h)
{
    if (vehicle->vehicle != BP_SKID_STEER)
        return false;
    const bp_state *state = &vehicle->state;
    double ground[2];
    ground_speeds(wheels, vehicle, h, ground);
    slip_t reached = wheels->body.ahead;
    reached.yaw_rate = 0.5 * (ground[0] - ground[1]) / vehicle->parameter[PARAMETER_HALF_TRACK];
    const double impulse = wheels->body.sway_impulse - wheels->body.sway_lever * (reached.yaw_rate - state->yaw_rate);
    reached.sway = state->sway + impulse / wheels->body.sway_mass;
    const bool over = wheels->body.turned > OVERLOAD * hold_of(vehicle, &reached, h).yaw;
    wheels->body.ahead = over ? reached : wheels->body.ahead;
    return over;
}

/* True if a tyre was expected to stick and its force was above its limit. Then its slip is set to the slip for this
 * force, so in each repetition the tyre holds less, by the ratio of the overload. */
static bool overloads(wheels_t *wheels, const vehicle_t *vehicle, double h)
{
    const double radius = vehicle->parameter[PARAMETER_WHEEL_RADIUS];
    const pair_t *grip_mass = &wheels->body.grip;
    if (!(vehicle->build.along.creep > 0))
        return false;
    const double ahead[2] = {radius * vehicle->build.rim[0] * vehicle->state.wheel_speed[0] - wheels->body.free[0],
                             radius * vehicle->build.rim[1] * vehicle->state.wheel_speed[1] - wheels->body.free[1]};
    const double impulse[2] = {grip_mass->left * ahead[0] + grip_mass->cross * ahead[1],
                               grip_mass->right * ahead[1] + grip_mass->cross * ahead[0]};
    slip_t reached = wheels->body.ahead;
    for (int k = 0; k < 2; k++)
        reached.along[k] = wheels->body.soft[k] * impulse[k];
    const hold_t hold = hold_of(vehicle, &reached, h);
    bool over = false;
    for (int k = 0; k < 2; k++) {
        const bool this_one = hold.along[k] > OVERLOAD * h * wheels->body.soft[k];
        wheels->body.ahead.along[k] = this_one ? reached.along[k] : wheels->body.ahead.along[k];
        over = over || this_one;
    }
    return drags(wheels, vehicle, h) || over;
}

static void follow(wheels_t *wheels, vehicle_t *vehicle, double h)
{
    bp_state *state = &vehicle->state;
    const double surge = state->surge, sway = state->sway, yaw_rate = state->yaw_rate;
    double ground[2];
    ground_speeds(wheels, vehicle, h, ground);
    state->surge = 0.5 * (ground[0] + ground[1]);
    state->yaw_rate = 0.5 * (ground[0] - ground[1]) / vehicle->parameter[PARAMETER_HALF_TRACK];
    if (wheels->body.sway_mass > 0) {
        const double impulse = wheels->body.sway_impulse - wheels->body.sway_lever * (state->yaw_rate - yaw_rate);
        state->sway += impulse / wheels->body.sway_mass;
    }
    wheels->body.travel_surge += 0.5 * h * (surge + state->surge);
    wheels->body.travel_sway += 0.5 * h * (sway + state->sway);
    wheels->body.turn += 0.5 * h * (yaw_rate + state->yaw_rate);
}

static void finish(const wheels_t *wheels, vehicle_t *vehicle, const bp_state *before, double step)
{
    body_accelerations(vehicle, before, step);
    body_move(&vehicle->state, wheels->body.travel_surge, wheels->body.travel_sway, wheels->body.turn);
}

const contact_t contact_slip = {
    .prepare = prepare, .finish = finish, .expect = expect, .grip = grip, .overloads = overloads, .follow = follow};
