#include "effects/effect.h"

#include <math.h>
#include <stddef.h>

#include "effects/composed_laws.h"
#include "effects/composed_rows.h"
#include "effects/slope.h"

static const double PI = 3.14159265358979323846;

enum { PLACE_DRIVE, PLACE_LOSS, PLACE_WHEEL, PLACE_BODY, PLACE_FLOOR, PLACE_ENCODER, PLACE_IMU, PLACE_COUNT };

typedef struct {
    double position, speed, push; /* m, m/s, m/s^2; for yaw rad, rad/s, rad/s^2 */
} sprung_t;

typedef struct {
    double acts[PLACE_COUNT]; /* 0 if every coefficient of the place is 0 */
    double start_age;
    double time;     /* s since the run's start, counted in motor steps */
    double speed[2]; /* speeds of the wheels one body step ago, rad/s */
    double step;     /* s: length of the last body step */
    double dry_surge, dry_yaw;
    sprung_t surge, yaw;
    double wheel_error[2], wheel_angle[2]; /* rad/s, rad: error of the rotation sensors' readings */
    double gyro_error, gyro_angle;         /* rad/s, rad: error of the gyro's readings */
} memory_t;

/* Evaluates a law at the left (k = 0) or right wheel (k = 1). Terms of a difference act only on a robot, not on a
 * motor. */
static double sided(composed_sum_t *sum, const double *common, const double *diff, const composed_t *given,
                    const composed_point_t *at, const vehicle_t *vehicle, int k)
{
    const double both = sum(common, given, at);
    if (vehicle->vehicle == BP_MOTOR)
        return both;
    return both + (k == 0 ? 1 : -1) * sum(diff, given, at);
}

static double within(double low, double value, double high)
{
    return fmin(fmax(value, low), high);
}

static double volts(const vehicle_t *vehicle, int k)
{
    return k >= vehicle_wheels(vehicle) || isnan(vehicle->voltage[k]) ? 0 : vehicle->voltage[k];
}

/* Returns 1 if any value between two members of composed_t is not 0. The members are given by their offsets. */
static double any(const double *value, size_t first, size_t end)
{
    for (size_t i = first / sizeof *value; i < end / sizeof *value; i++)
        if (value[i] != 0)
            return 1;
    return 0;
}

static void start(const double *value, double *memory, vehicle_t *vehicle)
{
    memory_t *kept = (memory_t *)memory;
    kept->acts[PLACE_DRIVE] = any(value, offsetof(composed_t, drive_gain), offsetof(composed_t, wheel_loss));
    kept->acts[PLACE_LOSS] = any(value, offsetof(composed_t, wheel_loss), offsetof(composed_t, wheel_dry));
    kept->acts[PLACE_WHEEL] = any(value, offsetof(composed_t, wheel_dry), offsetof(composed_t, surge_dry));
    kept->acts[PLACE_BODY] = any(value, offsetof(composed_t, surge_dry), offsetof(composed_t, floor_add));
    kept->acts[PLACE_FLOOR] = any(value, offsetof(composed_t, floor_add), offsetof(composed_t, encoder_gain));
    kept->acts[PLACE_ENCODER] = any(value, offsetof(composed_t, encoder_gain), offsetof(composed_t, gyro_add));
    kept->acts[PLACE_IMU] = any(value, offsetof(composed_t, gyro_add), offsetof(composed_t, frequency));
    kept->start_age = vehicle->state.age;
    kept->speed[0] = vehicle->state.wheel_speed[0];
    kept->speed[1] = vehicle->state.wheel_speed[1];
}

/* The time t of the terms in s, at `since` s after the run's start. */
static double clock_time(const composed_t *given, const memory_t *kept, double since)
{
    return since + given->clock * kept->start_age;
}

/* Multiplies each voltage by a gain, limited to 0..2, and adds a voltage to the product. */
static void drive(const double *value, double *memory, vehicle_t *vehicle)
{
    const composed_t *given = (const composed_t *)value;
    const memory_t *kept = (const memory_t *)memory;
    if (kept->acts[PLACE_DRIVE] == 0)
        return;
    const double before[2] = {volts(vehicle, 0), volts(vehicle, 1)};
    for (int k = 0; k < vehicle_wheels(vehicle); k++) {
        const composed_point_t at = {.V = before[k],
                                     .other = before[1 - k],
                                     .w = vehicle->state.wheel_speed[k],
                                     .t = clock_time(given, kept, kept->time + 0.5 * vehicle->step)};
        const double gain =
            sided(composed_drive_gain, given->drive_gain, given->drive_gain_diff, given, &at, vehicle, k);
        const double more = sided(composed_drive_add, given->drive_add, given->drive_add_diff, given, &at, vehicle, k);
        vehicle->voltage[k] = vehicle->voltage[k] * within(0, 1 + gain, 2) + more;
    }
}

/* Adds losses to the motors' own losses. The integrator treats the sum implicitly, and the sum never drives a wheel. */
static void motor(const double *value, double *memory, vehicle_t *vehicle)
{
    const composed_t *given = (const composed_t *)value;
    memory_t *kept = (memory_t *)memory;
    if (kept->acts[PLACE_LOSS] == 0)
        return;
    const double half = 0.5 * vehicle->step;
    for (int k = 0; k < vehicle_wheels(vehicle); k++) {
        const double speed = vehicle->state.wheel_speed[k];
        const composed_point_t at = {.w = speed + 0.5 * (speed - kept->speed[k]),
                                     .t = clock_time(given, kept, kept->time + half)};
        const double loss =
            sided(composed_wheel_loss, given->wheel_loss, given->wheel_loss_diff, given, &at, vehicle, k);
        vehicle->motor[k].drag = fmax(vehicle->motor[k].drag + loss, 0);
        kept->speed[k] = speed;
    }
}

static void wheel(const double *value, double *memory, vehicle_t *vehicle)
{
    const composed_t *given = (const composed_t *)value;
    memory_t *kept = (memory_t *)memory;
    const double half = 0.5 * vehicle->step;
    for (int k = 0; k < vehicle_wheels(vehicle) && kept->acts[PLACE_WHEEL] != 0; k++) {
        const double speed = vehicle->state.wheel_speed[k], current = vehicle->state.current[k];
        const composed_point_t at = {.V = volts(vehicle, k),
                                     .i = current,
                                     .w = speed,
                                     .theta = vehicle->state.wheel_angle[k] + half * speed,
                                     .t = clock_time(given, kept, kept->time + half)};
        const double dry = sided(composed_wheel_dry, given->wheel_dry, given->wheel_dry_diff, given, &at, vehicle, k);
        const double gain =
            sided(composed_wheel_gain, given->wheel_gain, given->wheel_gain_diff, given, &at, vehicle, k);
        const double push =
            sided(composed_wheel_push, given->wheel_push, given->wheel_push_diff, given, &at, vehicle, k);
        vehicle->dry[DRY_LEFT + k] += fmax(dry, 0);
        vehicle->wheel_torque[k] += within(-1, gain, 1) * vehicle->motor[k].torque_constant * current + push;
    }
    vehicle->dry[DRY_SURGE] += kept->dry_surge;
    vehicle->dry[DRY_YAW] += kept->dry_yaw;
    kept->time += vehicle->step;
}

/* Moves a mass on a spring and a damper over h s, by the implicit midpoint rule. The body that carries the mass
 * accelerated with `rate`. */
static void swing(sprung_t *mass, const composed_t *given, double rate, double h)
{
    const double p = 2 * PI * given->frequency, loss = given->damping * p;
    const double before = mass->speed;
    mass->speed = (before * (1 - h * loss - 0.25 * h * h * p * p) - h * (rate + p * p * mass->position)) /
                  (1 + h * loss + 0.25 * h * h * p * p);
    mass->position += 0.5 * h * (before + mass->speed);
    mass->push = p * p * (mass->position + 0.5 * h * mass->speed) + 2 * loss * mass->speed;
}

/* Travel in m per rad of the wheel; 0 for a motor without a wheel, whose load does not move. */
static double lever(const vehicle_t *vehicle)
{
    const double *p = vehicle->parameter;
    return vehicle->vehicle == BP_MOTOR && p[PARAMETER_FORCE_PER_VOLT] > 0 ? 1 : p[PARAMETER_WHEEL_RADIUS];
}

/* The wheels' losses as a drag on the surge, N s/m. Terms of the body may take away at most this drag. */
static double rolling_drag(const vehicle_t *vehicle)
{
    const double *p = vehicle->parameter;
    const double radius = lever(vehicle), weight = vehicle->build.mass * p[PARAMETER_GRAVITY];
    const double drag = p[PARAMETER_VISCOUS_FRICTION] + weight * p[PARAMETER_ROLLING_FRICTION] * radius * radius;
    return vehicle->profile == BP_PAPER || !(radius > 0) ? 0 : vehicle_wheels(vehicle) * drag / (radius * radius);
}

static double fourth_power(double value)
{
    return value * value * value * value;
}

static double patch_at(const composed_t *given, double x)
{
    const double off = (x - given->patch_x) / given->patch_half_width;
    return 1 / (1 + fourth_power(off * off));
}

static composed_point_t body_point(const composed_t *given, memory_t *kept, const vehicle_t *vehicle)
{
    const bp_state *state = &vehicle->state;
    const double half = 0.5 * vehicle->step, u = vehicle->middle.surge, psi = vehicle->middle.heading;
    composed_point_t at = {.u = u, .t = clock_time(given, kept, state->age - kept->start_age + half)};
    if (vehicle->vehicle == BP_MOTOR) {
        at.x = lever(vehicle) * state->wheel_angle[0] + half * u;
    } else {
        at.r = vehicle->middle.yaw_rate;
        at.psi = psi;
        at.x = state->x + half * (state->surge * cos(psi) - state->sway * sin(psi));
        at.y = state->y + half * (state->surge * sin(psi) + state->sway * cos(psi));
    }
    at.patch = patch_at(given, at.x);
    return at;
}

/* Gravity's pull at position x (in m). The sine of the floor's downward slope along x is limited to +-0.7. */
static pull_t pull_at(const composed_t *given, const vehicle_t *vehicle, double x, double heading)
{
    const composed_point_t at = {.x = x, .patch = patch_at(given, x)};
    return slope_pull(vehicle, within(-0.7, composed_floor_add(given->floor_add, given, &at), 0.7), 0, heading);
}

static void push_body(const composed_t *given, memory_t *kept, vehicle_t *vehicle)
{
    composed_point_t at = body_point(given, kept, vehicle);
    swing(&kept->surge, given, vehicle->surge_rate, kept->step);
    swing(&kept->yaw, given, vehicle->yaw_accel, kept->step);
    kept->step = vehicle->step;

    const double least = -rolling_drag(vehicle), half_track = vehicle->parameter[PARAMETER_HALF_TRACK];
    at.sprung = kept->surge.push;
    kept->dry_surge = fmax(composed_surge_dry(given->surge_dry, given, &at), 0);
    vehicle->drag_surge = fmax(vehicle->drag_surge + composed_surge_loss(given->surge_loss, given, &at), least);
    vehicle->force_surge += composed_surge_push(given->surge_push, given, &at);
    if (vehicle->vehicle == BP_MOTOR)
        return;
    at.sprung = kept->yaw.push;
    kept->dry_yaw = fmax(composed_yaw_dry(given->yaw_dry, given, &at), 0);
    vehicle->drag_yaw =
        fmax(vehicle->drag_yaw + composed_yaw_loss(given->yaw_loss, given, &at), least * half_track * half_track);
    vehicle->moment_yaw += composed_yaw_push(given->yaw_push, given, &at);
}

/* The floor terms act only on a robot: on a motor their pull would be a force on the load. */
static void body(const double *value, double *memory, vehicle_t *vehicle)
{
    const composed_t *given = (const composed_t *)value;
    memory_t *kept = (memory_t *)memory;
    if (kept->acts[PLACE_FLOOR] != 0 && vehicle->vehicle != BP_MOTOR) {
        const composed_point_t at = body_point(given, kept, vehicle);
        slope_push(vehicle, pull_at(given, vehicle, at.x, at.psi));
    }
    if (kept->acts[PLACE_BODY] != 0)
        push_body(given, kept, vehicle);
}

/* Adds the error of the wheel speeds. Its integral since the run's start is the error of the angles. */
static void misread_wheels(const composed_t *given, memory_t *kept, vehicle_t *vehicle)
{
    const bp_state *state = &vehicle->state;
    const double radius = vehicle->parameter[PARAMETER_WHEEL_RADIUS];
    for (int k = 0; k < 2; k++) {
        const composed_point_t at = {.w = state->wheel_speed[k],
                                     .theta = state->wheel_angle[k],
                                     .t = clock_time(given, kept, state->age - kept->start_age)};
        const double gain =
            sided(composed_encoder_gain, given->encoder_gain, given->encoder_gain_diff, given, &at, vehicle, k);
        const double error = gain * state->wheel_speed[k];
        kept->wheel_angle[k] += 0.5 * vehicle->step * (kept->wheel_error[k] + error);
        kept->wheel_error[k] = error;
        vehicle->output[OUTPUT_WHEEL_SPEED_LEFT + k] += error;
        vehicle->output[OUTPUT_WHEEL_ANGLE_LEFT + k] += kept->wheel_angle[k];
        vehicle->output[OUTPUT_WHEEL_TRAVEL_LEFT + k] += radius * kept->wheel_angle[k];
        vehicle->output[OUTPUT_WHEEL_VELOCITY_LEFT + k] += radius * error;
    }
}

static void misread_motion(const composed_t *given, memory_t *kept, vehicle_t *vehicle)
{
    const bp_state *state = &vehicle->state;
    double *output = vehicle->output;
    const composed_point_t at = {.u = state->surge,
                                 .r = state->yaw_rate,
                                 .a = output[OUTPUT_ACCEL_SURGE],
                                 .b = output[OUTPUT_ACCEL_SWAY],
                                 .i_left = state->current[0],
                                 .i_right = state->current[1],
                                 .t = clock_time(given, kept, state->age - kept->start_age)};
    const double error = composed_gyro_add(given->gyro_add, given, &at);
    kept->gyro_angle += 0.5 * vehicle->step * (kept->gyro_error + error);
    kept->gyro_error = error;
    output[OUTPUT_YAW_RATE] += error;
    output[OUTPUT_YAW_ANGLE] += kept->gyro_angle;
    output[OUTPUT_ACCEL_SURGE] += composed_accel_surge_add(given->accel_surge_add, given, &at);
    output[OUTPUT_ACCEL_SWAY] += composed_accel_sway_add(given->accel_sway_add, given, &at);
}

/* Terms of sensors act only on a robot, not on a motor. */
static void sensor(const double *value, double *memory, vehicle_t *vehicle)
{
    const composed_t *given = (const composed_t *)value;
    memory_t *kept = (memory_t *)memory;
    if (vehicle->vehicle == BP_MOTOR)
        return;
    if (kept->acts[PLACE_FLOOR] != 0)
        slope_show(vehicle, pull_at(given, vehicle, slope_position(vehicle), slope_heading(vehicle)));
    if (kept->acts[PLACE_ENCODER] != 0)
        misread_wheels(given, kept, vehicle);
    if (kept->acts[PLACE_IMU] != 0)
        misread_motion(given, kept, vehicle);
}

/* clang-format off */
static const bp_parameter_info PARAMETERS[COMPOSED_COUNT] = {
    COMPOSED_DRIVE_GAIN(ROW_DRIVE_GAIN) COMPOSED_DRIVE_GAIN(ROW_DRIVE_GAIN_DIFF)
    COMPOSED_DRIVE_ADD(ROW_DRIVE_ADD) COMPOSED_DRIVE_ADD(ROW_DRIVE_ADD_DIFF)
    COMPOSED_WHEEL_LOSS(ROW_WHEEL_LOSS) COMPOSED_WHEEL_LOSS(ROW_WHEEL_LOSS_DIFF)
    COMPOSED_WHEEL_DRY(ROW_WHEEL_DRY) COMPOSED_WHEEL_DRY(ROW_WHEEL_DRY_DIFF)
    COMPOSED_WHEEL_GAIN(ROW_WHEEL_GAIN) COMPOSED_WHEEL_GAIN(ROW_WHEEL_GAIN_DIFF)
    COMPOSED_WHEEL_PUSH(ROW_WHEEL_PUSH) COMPOSED_WHEEL_PUSH(ROW_WHEEL_PUSH_DIFF)
    COMPOSED_SURGE_DRY(ROW_SURGE_DRY) COMPOSED_SURGE_LOSS(ROW_SURGE_LOSS) COMPOSED_SURGE_PUSH(ROW_SURGE_PUSH)
    COMPOSED_YAW_DRY(ROW_YAW_DRY) COMPOSED_YAW_LOSS(ROW_YAW_LOSS) COMPOSED_YAW_PUSH(ROW_YAW_PUSH)
    COMPOSED_FLOOR_ADD(ROW_FLOOR_ADD)
    COMPOSED_ENCODER_GAIN(ROW_ENCODER_GAIN) COMPOSED_ENCODER_GAIN(ROW_ENCODER_GAIN_DIFF)
    COMPOSED_GYRO_ADD(ROW_GYRO_ADD)
    COMPOSED_ACCEL_SURGE_ADD(ROW_ACCEL_SURGE_ADD) COMPOSED_ACCEL_SWAY_ADD(ROW_ACCEL_SWAY_ADD)
    {.name = "frequency", .role = BP_ROLE_SHAPE, .unit = "Hz", .minimum = 1e-3, .maximum = 1000, .preset = 1,
     .meaning = "frequency of what is periodic in time, and of the sprung mass"},
    {.name = "order", .role = BP_ROLE_SHAPE, .unit = "1", .linear_unit = "rad/m", .minimum = 0, .maximum = 10000,
     .preset = 1, .meaning = "periods per turn of the wheel"},
    {.name = "wavelength", .role = BP_ROLE_SHAPE, .unit = "m", .minimum = 1e-3, .maximum = 1000, .preset = 0.5,
     .meaning = "wavelength of what is periodic in x"},
    {.name = "patch_x", .role = BP_ROLE_PLACE, .unit = "m", .minimum = -1000, .maximum = 1000, .preset = 0.5,
     .meaning = "x of the middle of the patch"},
    {.name = "patch_half_width", .role = BP_ROLE_SHAPE, .unit = "m", .minimum = 1e-3, .maximum = 1000, .preset = 0.2,
     .meaning = "distance from the middle of the patch to where half of it is left"},
    {.name = "damping", .role = BP_ROLE_SHAPE, .unit = "1", .minimum = 0, .maximum = 10, .preset = 0.1,
     .meaning = "damping ratio of the sprung mass"},
    {.name = "clock", .role = BP_ROLE_SWITCH, .unit = "1", .minimum = 0, .maximum = 1, .preset = 0,
     .meaning = "0: t counts from each run's start; 1: from power-on"},
};
/* clang-format on */

const effect_t effect_composed_term = {
    .info = {.name = "composed_term",
             .words = "a composed term",
             .summary = "A sum of a few simple terms stands for what has no name.",
             .mechanism = "body",
             .acts_on = "body",
             .equation = "the sum of the terms below whose coefficient c is not 0. They act on the voltage V of each "
                         "motor, the torque T of each wheel, the force X ahead, the moment N, the slope of the floor, "
                         "which is the sine of the angle by which it falls along x, or a sensor's reading; side is 1 "
                         "left and -1 right. A factor of V, or of K_t i, is at most 1 in size, a slope 0.7. A term "
                         "against sign(w), sign(u) or sign(r) is dry friction, which holds at rest and never pushes. A "
                         "loss, a factor of w, u or r in T, X or N, takes away at most the linear losses. On a motor "
                         "act only the terms of V, T and X without a side",
             .source = "sparse regression of dynamics: Brunton, Proctor & Kutz 2016, PNAS 113(15); of a discrepancy: "
                       "Kaheman, Kaiser, Strom, Kutz & Brunton 2019",
             .prior = BP_PRIOR_RARE,
             .prior_reason = "A law that nobody has named explains data less often than one that has a name.",
             .parameter_count = COMPOSED_COUNT,
             .parameters = PARAMETERS,
             .composed = 1},
    .memory_count = sizeof(memory_t) / sizeof(double),
    .hook = {[SITE_START] = start,
             [SITE_DRIVE] = drive,
             [SITE_MOTOR] = motor,
             [SITE_WHEEL] = wheel,
             [SITE_BODY] = body,
             [SITE_SENSOR] = sensor},
};
