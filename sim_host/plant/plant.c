#include "plant/plant.h"

#include <math.h>
#include <string.h>

#include "models/rcx_gen.h"
#include "plant/contact.h"
#include "plant/contact_load.h"
#include "plant/output.h"

/* Fraction of a step by which an interval may exceed a whole number of steps: so rounding of sample times adds no
 * step. */
static const double STEP_SLACK = 1e-6;

static void run_hooks(plant_t *plant, site_t site)
{
    for (int i = 0; i < plant->hook_count[site]; i++) {
        const plant_hook_t *hook = &plant->hook[site][i];
        hook->hook(hook->value, hook->memory, &plant->vehicle);
    }
}

static void gather_hooks(plant_t *plant, const bp_model *model)
{
    double *memory = plant->memory;
    memset(plant->hook_count, 0, sizeof plant->hook_count);
    for (int i = 0; i < model->effect_count; i++) {
        const effect_t *effect = model->effect[i].effect;
        memset(memory, 0, (size_t)effect->memory_count * sizeof *memory);
        for (int site = 0; site < SITE_COUNT; site++)
            if (effect->hook[site] != NULL)
                plant->hook[site][plant->hook_count[site]++] =
                    (plant_hook_t){effect->hook[site], model->effect[i].value, memory};
        memory += effect->memory_count;
    }
}

/* The nominal motor of one side. The rolling friction of eq. 13 is, in eq. 14, a loss linear in the speed: m g sigma
 * r_w abs(w) at the radius r_w. */
static motor_t nominal_motor(const vehicle_t *vehicle, int side)
{
    const double *p = vehicle->parameter;
    const double radius =
        vehicle->vehicle == BP_MOTOR ? contact_load_lever(p) : p[PARAMETER_WHEEL_RADIUS] * vehicle->build.rim[side];
    const double weight = vehicle->build.mass * p[PARAMETER_GRAVITY];
    motor_t motor = {.resistance = p[PARAMETER_RESISTANCE],
                     .inductance = p[PARAMETER_INDUCTANCE],
                     .torque_constant = p[PARAMETER_TORQUE_CONSTANT],
                     .emf_constant = p[PARAMETER_EMF_CONSTANT],
                     .inertia = p[PARAMETER_WHEEL_INERTIA],
                     .drag = p[PARAMETER_VISCOUS_FRICTION] + weight * p[PARAMETER_ROLLING_FRICTION] * radius * radius};
    if (vehicle->vehicle == BP_MOTOR && (p[PARAMETER_FORCE_PER_VOLT] > 0 || p[PARAMETER_TORQUE_PER_VOLT] > 0)) {
        const bool linear = p[PARAMETER_FORCE_PER_VOLT] > 0;
        motor.torque_constant = 0;
        motor.emf_constant = 0;
        motor.torque_per_volt = linear ? p[PARAMETER_FORCE_PER_VOLT] : p[PARAMETER_TORQUE_PER_VOLT];
        motor.inertia = linear ? 0 : motor.inertia;
    }
    return motor;
}

void plant_nominal_motors(const vehicle_t *vehicle, motor_t motor[2])
{
    motor[0] = nominal_motor(vehicle, 0);
    motor[1] = vehicle->vehicle == BP_MOTOR ? (motor_t){.resistance = 1} : nominal_motor(vehicle, 1);
}

static void set_motors(plant_t *plant)
{
    plant_nominal_motors(&plant->vehicle, plant->vehicle.motor);
    run_hooks(plant, SITE_MOTOR);
}

/* Sets surge and yaw rate of a coupled vehicle from its wheel speeds. */
static void carry_body(vehicle_t *vehicle)
{
    bp_state *state = &vehicle->state;
    const double radius = vehicle->parameter[PARAMETER_WHEEL_RADIUS];
    const double half_track = vehicle->parameter[PARAMETER_HALF_TRACK];
    const double *rim = vehicle->build.rim;
    const double speed[2] = {rim[0] * state->wheel_speed[0], rim[1] * state->wheel_speed[1]};
    state->surge = 0.5 * radius * (speed[0] + speed[1]);
    state->yaw_rate = 0.5 * radius / half_track * (speed[0] - speed[1]);
}

/* Makes the speeds of wheels and body of a coupled vehicle agree at the start. If tyres slip, the speeds may differ. */
static void join_speeds(vehicle_t *vehicle)
{
    bp_state *state = &vehicle->state;
    const double radius = vehicle->parameter[PARAMETER_WHEEL_RADIUS];
    const double half_track = vehicle->parameter[PARAMETER_HALF_TRACK];
    const double *rim = vehicle->build.rim;
    if (state->wheel_speed[0] == 0 && state->wheel_speed[1] == 0) {
        state->wheel_speed[0] = (state->surge + half_track * state->yaw_rate) / (radius * rim[0]);
        state->wheel_speed[1] = (state->surge - half_track * state->yaw_rate) / (radius * rim[1]);
    }
    if (!(vehicle->build.along.creep > 0) || (state->surge == 0 && state->yaw_rate == 0))
        carry_body(vehicle);
    if (!(vehicle->build.across.creep > 0))
        state->sway = 0;
}

static void sense(plant_t *plant, double step)
{
    if (plant->hook_count[SITE_SENSOR] == 0)
        return;
    plant->vehicle.step = step;
    output_row(&plant->vehicle, plant->vehicle.output);
    run_hooks(plant, SITE_SENSOR);
}

typedef plant_t stepped_t;

static bool has_hooks(const plant_t *plant, site_t site)
{
    return plant->hook_count[site] > 0;
}

#include "plant/step.h"

/* The wheels of a skid steer always slip, so its own tyre law replaces the tyre laws that effects have set. */
static void build_contacts(vehicle_t *vehicle)
{
    if (vehicle->vehicle != BP_SKID_STEER)
        return;
    const double *p = vehicle->parameter;
    const double friction = p[PARAMETER_CONTACT_FRICTION], weight = vehicle->build.mass * p[PARAMETER_GRAVITY];
    const double creep = weight > 0 ? p[PARAMETER_SLIP_SPEED] / (0.5 * friction * weight) : 1;
    vehicle->build.along = vehicle->build.across = (tyre_t){.creep = creep, .friction = friction};
    vehicle->build.one_circle = 1;
}

static void start_state(vehicle_t *vehicle, const bp_state *initial)
{
    if (initial != NULL)
        vehicle->state = *initial;
    bp_state *state = &vehicle->state;
    if (vehicle->vehicle == BP_MOTOR) {
        state->current[1] = 0;
        state->wheel_speed[1] = 0;
        state->wheel_angle[1] = 0;
        state->heat[1] = 0;
        state->surge = contact_load_lever(vehicle->parameter) * state->wheel_speed[0];
    } else if (vehicle->profile == BP_COUPLED) {
        join_speeds(vehicle);
    }
    vehicle->accel_surge = -state->sway * state->yaw_rate;
    vehicle->accel_sway = state->surge * state->yaw_rate;
}

int plant_start(plant_t *plant, const bp_model *model, const bp_state *initial, double motor_step, double body_step)
{
    if ((initial != NULL && !step_finite(initial)) || !(motor_step >= 0) || !(body_step >= 0))
        return BP_E_RANGE;
    plant->model = model;
    plant->motor_step = motor_step > 0 ? motor_step : RCX_MOTOR_STEP;
    plant->body_step = body_step > 0 ? body_step : RCX_BODY_STEP;
    plant->wheels = (wheels_t){0};
    plant->vehicle = (vehicle_t){.parameter = model->parameter,
                                 .vehicle = model->vehicle,
                                 .profile = model->profile,
                                 .supply = model->parameter[PARAMETER_BATTERY_VOLTAGE],
                                 .build = {.mass = model->parameter[PARAMETER_MASS],
                                           .yaw_inertia = model->parameter[PARAMETER_YAW_INERTIA],
                                           .rim = {1, 1}}};
    vehicle_t *vehicle = &plant->vehicle;
    gather_hooks(plant, model);
    run_hooks(plant, SITE_BUILD);
    build_contacts(vehicle);
    start_state(vehicle, initial);
    run_hooks(plant, SITE_START);
    vehicle->state.rest = 0;
    set_motors(plant);
    run_hooks(plant, SITE_SUPPLY);
    contact_of(vehicle)->prepare(&plant->wheels, vehicle);
    if (!(plant->wheels.inertia.left > 0) || !(plant->wheels.inertia.right > 0))
        return BP_E_RANGE;
    sense(plant, 0);
    step_feel(plant); /* `felt` is 0 until here */
    return 0;
}

/* Returns `state` with each NaN replaced by the value in `now`. A state is made of doubles alone. */
static bp_state completed(const bp_state *state, const bp_state *now)
{
    enum { FIELDS = sizeof(bp_state) / sizeof(double) };
    double given[FIELDS], simulated[FIELDS];
    memcpy(given, state, sizeof given);
    memcpy(simulated, now, sizeof simulated);
    for (int i = 0; i < FIELDS; i++)
        given[i] = isnan(given[i]) ? simulated[i] : given[i];
    bp_state whole;
    memcpy(&whole, given, sizeof whole);
    return whole;
}

int plant_restart(plant_t *plant, const bp_state *state)
{
    vehicle_t *vehicle = &plant->vehicle;
    bp_state whole = completed(state, &vehicle->state);
    if (!step_finite(&whole))
        return BP_E_RANGE;
    const bool wheels_open = isnan(state->wheel_speed[0]) && isnan(state->wheel_speed[1]);
    const bool body_given = !isnan(state->surge) || !isnan(state->yaw_rate);
    if (vehicle->vehicle != BP_MOTOR && vehicle->profile == BP_COUPLED && wheels_open && body_given) {
        whole.wheel_speed[0] = 0; /* 0: start_state() takes the body's speeds */
        whole.wheel_speed[1] = 0;
    }
    start_state(vehicle, &whole);
    return 0;
}

/* Returns how many equal steps of at most `limit` make up `interval`: at least 1; -1: more than 1e9. */
static int even_steps(double interval, double limit)
{
    const double count = ceil(interval / limit - STEP_SLACK);
    return count > 1e9 ? -1 : count < 1 ? 1 : (int)count;
}

int plant_divide(const plant_t *plant, double dt, int *body_count, int *motor_count)
{
    *body_count = dt > 0 && isfinite(dt) ? even_steps(dt, plant->body_step) : -1;
    if (*body_count < 0)
        return BP_E_TIME;
    *motor_count = even_steps(dt / *body_count, plant->motor_step);
    return *motor_count < 0 ? BP_E_TIME : 0;
}

int plant_advance(plant_t *plant, const double input[2], double dt)
{
    int body_count, motor_count;
    const int status = plant_divide(plant, dt, &body_count, &motor_count);
    if (status != 0)
        return status;
    const double step = dt / body_count;
    const contact_t *contact = contact_of(&plant->vehicle);
    step_sample_begins(plant);
    for (int i = 0; i < body_count; i++)
        step_body(plant, contact, input, step, step / motor_count, motor_count);
    step_sample_ends(plant, body_count);
    return step_finite(&plant->vehicle.state) ? 0 : BP_E_DIVERGED;
}

void plant_outputs(const plant_t *plant, double *out)
{
    if (plant->hook_count[SITE_SENSOR] > 0)
        memcpy(out, plant->vehicle.output, sizeof plant->vehicle.output);
    else
        output_row(&plant->vehicle, out);
    output_felt(&plant->vehicle, out);
}
