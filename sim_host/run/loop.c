/* loop.c: the bp_loop_ functions: a closed loop whose controller is outside. brickpilot_sim.h is the manual. */
#include <stdlib.h>

#include "brickpilot_sim.h"
#include "run/flight.h"

struct bp_loop {
    bp_flight request;
    plant_t plant;
    flight_t flight;
};

bp_loop *bp_loop_open(const bp_flight *request, int *status)
{
    bp_loop *loop;

    *status = BP_E_RANGE;
    if (request->drive != NULL)
        return NULL;
    *status = BP_E_MEMORY;
    loop = calloc(1, sizeof *loop);
    if (loop == NULL)
        return NULL;
    loop->request = *request;
    *status = flight_prepare(&loop->flight, &loop->request, &loop->plant);
    if (*status == 0)
        return loop;
    free(loop);
    return NULL;
}

void bp_loop_sense(bp_loop *loop, bp_sensed *sensed)
{
    const sil_port_t *port = &loop->flight.port;

    flight_sense(&loop->flight);
    *sensed = (bp_sensed){.time_ms = port->clock_ms,
                          .imu_status = (int)port->imu_status,
                          .rotation_status = (int)port->rotation_status,
                          .battery_status = (int)port->battery_status,
                          .reference_status = (int)port->reference_status,
                          .accel_surge_mm_s2 = port->imu.accel_surge_mm_s2,
                          .accel_sway_mm_s2 = port->imu.accel_sway_mm_s2,
                          .yaw_rate_mrad_s = port->imu.yaw_rate_mrad_s,
                          .rotation_left = port->rotation.left,
                          .rotation_right = port->rotation.right,
                          .battery_mv = port->battery_mv,
                          .x_um = port->reference.x_um,
                          .y_um = port->reference.y_um,
                          .heading_bam16 = port->reference.heading_bam16,
                          .speed_mm_s_q4 = port->reference.speed_mm_s_q4,
                          .true_yaw_rate_mrad_s = port->reference.yaw_rate_mrad_s};
}

int bp_loop_act(bp_loop *loop, short left_q15, short right_q15)
{
    flight_t *flight = &loop->flight;
    double voltage[2];

    if (flight->step >= loop->request.steps)
        return BP_E_RANGE;
    flight->port.left_q15 = left_q15;
    flight->port.right_q15 = right_q15;
    flight_commanded_voltage(flight, voltage);
    flight_keep_step(flight, voltage, NULL);
    return flight_advance(flight, voltage);
}

void bp_loop_close(bp_loop *loop)
{
    free(loop);
}
