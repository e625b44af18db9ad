/* fly.c: closed loops with the firmware in process, one alone or several side by side: bp_fly() and bp_fly_many().
 * brickpilot_sim.h is the manual. */
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "app/params_gen.h"
#include "brickpilot_sim.h"
#include "plant/lanes.h"
#include "run/flight.h"

_Static_assert(STEP_MS % PLANT_STEP_MS == 0,
               "a step of the firmware is one of the plant, [rates] body_step, or several");

/* Sets the voltages of a manoeuvre: those of its schedule, and 0 after its path has been driven. */
static void follow_schedule(flight_t *flight, double voltage[2])
{
    const bp_flight *request = flight->request;
    const int step = flight->step;
    const double battery = flight->plant->vehicle.parameter[PARAMETER_BATTERY_VOLTAGE];
    const bool done = request->stop_path > 0 && flight->path >= request->stop_path;

    for (int side = 0; side < 2; side++)
        voltage[side] = done ? 0 : request->drive[2 * step + side];
    flight->port.left_q15 = isnan(voltage[0]) ? (int16_t)0 : flight_int16(voltage[0] / battery * 32767);
    flight->port.right_q15 = isnan(voltage[1]) ? (int16_t)0 : flight_int16(voltage[1] / battery * 32767);
    flight->path += fabs(flight->plant->vehicle.state.surge) * FLIGHT_STEP_S;
}

/* Runs the firmware in process if a step of it is due: a step of an RCX is longer than a step of the plant. The motors
 * keep their duty between two steps. */
static void control(flight_t *flight)
{
    const int every = STEP_MS / PLANT_STEP_MS;
    const int begins =
        (flight->request->start_step + every - 1) / every * every; /* the start command waits until a step is due */

    flight->port.link_out_size = 0;
    if (flight->step % every == 0)
        loop_tick(&flight->parameters.config, &flight->route, &flight->loop,
                  flight->step == begins ? MODE_START : MODE_NONE);
}

/* Does a control step without the plant. Sets the voltages for the plant's next step. */
static void fly_step(flight_t *flight, double voltage[2])
{
    const bool manoeuvre = flight->request->drive != NULL;

    flight_sense(flight);
    if (manoeuvre) {
        follow_schedule(flight, voltage);
    } else {
        sil_bind(&flight->port);
        control(flight);
        flight_commanded_voltage(flight, voltage);
    }
    flight_keep_step(flight, voltage, manoeuvre ? NULL : &flight->loop);
}

static int fly(flight_t *flight)
{
    int status = 0;

    while (status == 0 && flight->step < flight->request->steps) {
        double voltage[2];
        fly_step(flight, voltage);
        status = flight_advance(flight, voltage);
    }
    return status;
}

/* Prepares a flight with this plant. Returns 0 or a BP_E_ code. */
static int begin(flight_t *flight, const bp_flight *request, plant_t *plant)
{
    const int status = flight_prepare(flight, request, plant);
    if (status == 0) {
        sil_bind(&flight->port);
        loop_start(&flight->loop);
    }
    return status;
}

int bp_fly(bp_flight *request)
{
    plant_t plant;
    flight_t flight;

    request->status = begin(&flight, request, &plant);
    if (request->status == 0)
        request->status = fly(&flight);
    sil_bind(NULL);
    return request->status;
}

/* Flights whose plants advance side by side. */
typedef struct {
    lanes_t lanes;
    flight_t flight[LANES_MOST];
    bp_flight *request[LANES_MOST];
} side_by_side_t;

static void fly_lanes(side_by_side_t *side, int count)
{
    lanes_t *lanes = &side->lanes;

    lanes_open(lanes, count);
    for (int done = 0; done < side->request[0]->steps; done++) {
        double voltage[LANES_MOST][2] = {{0}};
        for (int lane = 0; lane < count; lane++) {
            if (lanes->status[lane] != 0)
                continue;
            if (done > 0)
                lanes_tell(lanes, lane);
            fly_step(&side->flight[lane], voltage[lane]);
        }
        lanes_advance(lanes, voltage, FLIGHT_STEP_S);
    }
    for (int lane = 0; lane < count; lane++)
        side->request[lane]->status = lanes->status[lane];
}

/* Begins each flight. A flight that fails ends here. A flight whose plant cannot go into a lane flies here, alone; the
 * others go on side by side. */
static void fly_group(side_by_side_t *side, bp_flight *requests, int count)
{
    int kept = 0;

    for (int i = 0; i < count; i++) {
        flight_t *flight = &side->flight[kept];
        plant_t *plant = &side->lanes.plant[kept];
        requests[i].status = begin(flight, &requests[i], plant);
        if (requests[i].status != 0)
            continue;
        if (requests[i].later == NULL && lanes_may_hold(plant))
            side->request[kept++] = &requests[i];
        else
            requests[i].status = fly(flight);
    }
    if (kept > 1)
        fly_lanes(side, kept);
    else if (kept == 1)
        side->request[0]->status = fly(&side->flight[0]);
    sil_bind(NULL);
}

static bool go_together(const bp_flight *a, const bp_flight *b)
{
    return a->model != NULL && b->model != NULL && a->model->vehicle == b->model->vehicle &&
           a->model->profile == b->model->profile && a->steps == b->steps &&
           memcmp(&a->motor_step, &b->motor_step, sizeof a->motor_step) == 0;
}

int bp_fly_many(bp_flight *requests, int count, int lanes)
{
    const int widest = lanes_widest(lanes);
    side_by_side_t *side = widest > 1 && count > 1 ? malloc(sizeof *side) : NULL;
    int status = 0;

    for (int i = 0, together; i < count; i += together) {
        together = 1;
        while (side != NULL && together < widest && i + together < count &&
               go_together(&requests[i], &requests[i + together]))
            together++;
        if (together > 1)
            fly_group(side, &requests[i], together);
        else
            bp_fly(&requests[i]);
    }
    free(side);
    for (int i = 0; i < count && status == 0; i++)
        status = requests[i].status;
    return status;
}

int bp_plant_size(void)
{
    return (int)sizeof(lanes_t); /* lanes_t holds the plants */
}
