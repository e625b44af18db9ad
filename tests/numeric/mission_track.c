#include "mission_track.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "double_paper_body.h"
#include "models/rcx_gen.h"
#include "plant/plant.h"
#include "sensors/battery.h"
#include "unity.h"

enum { WINDOW_STEPS = 1000 };
static const double PERIOD_S = 0.003, TURN = 6.28318530717958647692;

/* `waypoint` is the one steered to in this step. */
static void record(track_t *track, const mission_t *mission, int step, const double position[2], int waypoint,
                   bool arrived)
{
    track->x[step] = position[0];
    track->y[step] = position[1];
    for (int i = 0; i < mission->count; i++)
        if (isnan(track->reached[i]) && (waypoint > i || arrived))
            track->reached[i] = step * PERIOD_S;
}

static void clear(track_t *track)
{
    for (int i = 0; i < MISSION_WAYPOINTS; i++)
        track->reached[i] = NAN;
}

static int column(const char *name)
{
    int index = 0;
    while (strcmp(bp_log_name(index), name) != 0)
        index++;
    return index;
}

static int columns(void)
{
    int count = 0;
    while (bp_log_name(count) != NULL)
        count++;
    return count;
}

void mission_fly_firmware(const mission_t *mission, track_t *track)
{
    const int x = column("true_x_m"), y = column("true_y_m"), waypoint = column("waypoint"), mode = column("mode");
    const size_t width = (size_t)columns();
    double *log = malloc(width * MISSION_STEPS * sizeof *log);
    bp_model *model = bp_model_new(BP_DIFF_DRIVE, mission->profile);
    bp_flight flight = {.model = model,
                        .controller = mission->profile,
                        .sensors = BP_SENSORS_IDEAL,
                        .initial = {.heading = mission->heading},
                        .steps = MISSION_STEPS,
                        .waypoint_count = mission->count,
                        .waypoints = mission->waypoints,
                        .cruise = mission->cruise,
                        .log = log};

    TEST_ASSERT_EQUAL_INT(0, bp_fly(&flight));
    clear(track);
    for (int step = 0; step < MISSION_STEPS; step++) {
        const double *row = log + (size_t)step * width;
        record(track, mission, step, (double[]){row[x], row[y]}, (int)row[waypoint], row[mode] == MODE_ARRIVED);
    }
    bp_model_free(model);
    free(log);
}

void mission_fly_double(const mission_t *mission, const double_constants_t *constants, track_t *track)
{
    const double_route_t route = {mission->waypoints, mission->count};
    const bp_state initial = {.heading = mission->heading};
    double_constants_t own = *constants;
    double_controller_t controller = {0};
    bp_model *model = bp_model_new(BP_DIFF_DRIVE, mission->profile);
    plant_t plant;

    own.cruise = mission->cruise;
    TEST_ASSERT_EQUAL_INT(0, plant_start(&plant, model, &initial, 0, 0));
    const bp_state *truth = &plant.vehicle.state;
    double_controller_start(&own, &route, &controller, truth);
    clear(track);
    for (int step = 0; step < MISSION_STEPS; step++) {
        double voltage[2];
        double_controller_step(&own, &route, &controller, truth, RCX_BATTERY_VOLTAGE, PERIOD_S, voltage);
        record(track, mission, step, (double[]){truth->x, truth->y}, controller.waypoint,
               controller.mode == DOUBLE_ARRIVED);
        TEST_ASSERT_EQUAL_INT(0, plant_advance(&plant, voltage, PERIOD_S));
    }
    bp_model_free(model);
}

/* A vehicle for the firmware to fly: one of the two. */
typedef struct {
    const body_coefficients_t *coefficients; /* of the firmware's model; NULL: the double one */
    body_state_t model;
    double_paper_body_t paper;
} flown_t;

static signals_sensors_t reference_of_model(const body_state_t *body)
{
    return (signals_sensors_t){.reference_x_um = body->x_um,
                               .reference_y_um = body->y_um,
                               .reference_heading_bam16 = body_heading_bam16(body),
                               .reference_speed_mm_s_q4 = (int16_t)lround(body->motion.surge_mm_s_q17 / 8192.0),
                               .reference_yaw_rate_mrad_s = (int16_t)lround(body->motion.yaw_rate_mrad_s_q12 / 4096.0)};
}

static signals_sensors_t reference_of_state(const bp_state *state)
{
    return (signals_sensors_t){.reference_x_um = (int32_t)lround(state->x * 1e6),
                               .reference_y_um = (int32_t)lround(state->y * 1e6),
                               .reference_heading_bam16 = (uint16_t)lround(state->heading * (65536 / TURN)),
                               .reference_speed_mm_s_q4 = (int16_t)lround(state->surge * 16e3),
                               .reference_yaw_rate_mrad_s = (int16_t)lround(state->yaw_rate * 1e3)};
}

static void sense(const flown_t *flown, signals_sensors_t *sensors)
{
    const battery_config_t battery = battery_config_default();
    *sensors =
        flown->coefficients != NULL ? reference_of_model(&flown->model) : reference_of_state(&flown->paper.state);
    sensors->have = SENSOR_REFERENCE | SENSOR_BATTERY;
    sensors->period_ms = BODY_PERIOD_MS;
    sensors->battery_mv = (uint16_t)lround(battery_read(&battery, RCX_BATTERY_VOLTAGE) * 1e3);
}

static void advance(flown_t *flown, const signals_drive_t *drive)
{
    const double left = drive->left_q15 / 32767.0 * RCX_BATTERY_VOLTAGE;
    const double right = drive->right_q15 / 32767.0 * RCX_BATTERY_VOLTAGE;
    if (flown->coefficients != NULL)
        body_step(flown->coefficients, &flown->model, (int16_t)lround(left * 1e3), (int16_t)lround(right * 1e3));
    else
        double_paper_body_step(&flown->paper, (double[]){left, right});
}

static void set_route(const mission_t *mission, route_waypoint_t waypoints[MISSION_WAYPOINTS], route_t *route)
{
    for (int i = 0; i < mission->count; i++)
        waypoints[i] = (route_waypoint_t){(int16_t)lround(mission->waypoints[2 * i] * 1e3),
                                          (int16_t)lround(mission->waypoints[2 * i + 1] * 1e3)};
    TEST_ASSERT_EQUAL(ROUTE_OK, route_set(route, waypoints, (uint8_t)mission->count));
}

static void fly(const mission_t *mission, const loop_config_t *config, flown_t *flown, track_t *track)
{
    step_config_t own = config->step;
    route_waypoint_t waypoints[MISSION_WAYPOINTS];
    route_t route;
    step_state_t state = {0};
    signals_sensors_t sensors;
    step_output_t output;

    own.mode.los.cruise_mm_s_q4 = (int16_t)lround(mission->cruise * 16e3);
    set_route(mission, waypoints, &route);
    clear(track);
    for (int step = 0; step < MISSION_STEPS; step++) {
        const bool model = flown->coefficients != NULL;
        const double position[] = {model ? flown->model.x_um * 1e-6 : flown->paper.state.x,
                                   model ? flown->model.y_um * 1e-6 : flown->paper.state.y};
        sense(flown, &sensors);
        step_run(&own, &route, &state, &sensors, step == 0 ? MODE_START : MODE_NONE, &output);
        record(track, mission, step, position, state.mode.los.waypoint, state.mode.mode == MODE_ARRIVED);
        advance(flown, &output.drive);
    }
}

void mission_fly_model(const mission_t *mission, const loop_config_t *config, track_t *track)
{
    const uint32_t heading_bam32 = (uint32_t)llround(mission->heading * (4294967296.0 / TURN));
    flown_t flown = {.coefficients = config->step.model, .model = {.heading_bam32 = heading_bam32}};
    fly(mission, config, &flown, track);
}

void mission_fly_paper_body(const mission_t *mission, const loop_config_t *config, track_t *track)
{
    flown_t flown = {.paper = {.state = {.heading = mission->heading}}};
    fly(mission, config, &flown, track);
}

/* Until the later of both has arrived: in `paper` nothing stops the drift of a robot whose motors are off. */
static int steps_flown(const mission_t *mission, const track_t *a, const track_t *b)
{
    const double last_a = a->reached[mission->count - 1], last_b = b->reached[mission->count - 1];
    return isnan(last_a) || isnan(last_b) ? MISSION_STEPS : (int)lround(fmax(last_a, last_b) / PERIOD_S) + 1;
}

double mission_apart(const mission_t *mission, const track_t *a, const track_t *b)
{
    const int steps = steps_flown(mission, a, b);
    double largest = 0;
    for (int k = 0; k < steps; k++)
        largest = fmax(largest, hypot(a->x[k] - b->x[k], a->y[k] - b->y[k]));
    return largest;
}

/* From (x, y) to the straight piece between steps k and k + 1, squared. */
static double squared_to_piece(const track_t *curve, int k, double x, double y)
{
    const double along_x = curve->x[k + 1] - curve->x[k], along_y = curve->y[k + 1] - curve->y[k];
    const double from_x = x - curve->x[k], from_y = y - curve->y[k];
    const double length = along_x * along_x + along_y * along_y;
    const double share = length > 0 ? fmax(0, fmin(1, (from_x * along_x + from_y * along_y) / length)) : 0;
    const double off_x = from_x - share * along_x, off_y = from_y - share * along_y;
    return off_x * off_x + off_y * off_y;
}

/* Squared distance of step k of the track from the curve, or of less than `enough`: searched outwards from k. */
static double squared_to_curve(const track_t *track, const track_t *curve, int k, double enough)
{
    double nearest = INFINITY;
    for (int away = 0; away < WINDOW_STEPS && nearest > enough; away++) {
        if (k + away < MISSION_STEPS - 1)
            nearest = fmin(nearest, squared_to_piece(curve, k + away, track->x[k], track->y[k]));
        if (k - away >= 0 && k - away < MISSION_STEPS - 1)
            nearest = fmin(nearest, squared_to_piece(curve, k - away, track->x[k], track->y[k]));
    }
    return nearest;
}

double mission_curves_apart(const mission_t *mission, const track_t *a, const track_t *b)
{
    const int steps = steps_flown(mission, a, b);
    double largest = 0;
    for (int k = 0; k < steps; k++) {
        largest = fmax(largest, squared_to_curve(a, b, k, largest));
        largest = fmax(largest, squared_to_curve(b, a, k, largest));
    }
    return sqrt(largest);
}

double mission_times_apart(const mission_t *mission, const track_t *a, const track_t *b)
{
    double largest = 0;
    for (int i = 0; i < mission->count; i++) {
        if (isnan(a->reached[i]) || isnan(b->reached[i]))
            return INFINITY;
        largest = fmax(largest, fabs(a->reached[i] - b->reached[i]));
    }
    return largest;
}
