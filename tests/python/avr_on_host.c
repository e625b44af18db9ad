/* avr_on_host.c: the control loop on this machine, fed with what an AVR's loop had in its memory after each tick, and compared with it.
 *
 *   avr_on_host                     prints the size of a record and where its tick stands
 *   avr_on_host CRUISE_NUMBER CRUISE_RAW X Y [X Y...] < records
 *
 * Each record is a loop_state_t in the AVR's layout, which has no padding: compile this with -fpack-struct -fshort-enums. A record's
 * readings and clock go into the port, one tick runs, and its whole state must be that of the record. The first record is the
 * state from which both begin. Prints how many records were read, how many differ and the first that does, or -1.
 */
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/parameters.h"
#include "app/params_gen.h"
#include "sil/sil.h"

static void put_readings(sil_port_t *port, const signals_sensors_t *sensors)
{
    const uint8_t have = sensors->have;

    port->imu = (hal_imu_t){sensors->accel_surge_mm_s2, sensors->accel_sway_mm_s2, sensors->yaw_rate_mrad_s};
    port->imu_status = (have & SENSOR_ACCELEROMETER) != 0 ? HAL_OK : (have & SENSOR_GYRO) != 0 ? HAL_PARTLY : HAL_STALE;
    port->rotation = (hal_rotation_t){sensors->rotation_left, sensors->rotation_right};
    port->rotation_status = (have & SENSOR_ROTATION) != 0 ? HAL_OK : HAL_ABSENT;
    port->battery_mv = sensors->battery_mv;
    port->battery_status = (have & SENSOR_BATTERY) != 0 ? HAL_OK : HAL_STALE;
    port->reference_status = HAL_ABSENT;
}

int main(int count, char **argument)
{
    static parameters_t parameters;
    static route_waypoint_t waypoints[ROUTE_WAYPOINTS_MAX];
    static route_t route;
    static loop_state_t state, record;
    sil_port_t port = {0};
    int records = 0, differing = 0, first = -1, points = 0;

    if (count == 1)
        return printf("%d %d\n", (int)sizeof record, (int)offsetof(loop_state_t, tick)) < 0;
    parameters_start(&parameters, &PARAMS_COUPLED);
    if (parameters_write(&parameters, (uint8_t)atoi(argument[1]), atoi(argument[2]), false) != PARAMETERS_OK)
        return 1;
    for (int i = 3; i + 1 < count; i += 2)
        waypoints[points++] = (route_waypoint_t){(int16_t)atoi(argument[i]), (int16_t)atoi(argument[i + 1])};
    if (route_set(&route, waypoints, (uint8_t)points) != ROUTE_OK)
        return 1;
    sil_bind(&port);
    if (fread(&state, sizeof state, 1, stdin) != 1)
        return 1;
    while (fread(&record, sizeof record, 1, stdin) == 1) {
        const bool starts = record.step.mode.mode == MODE_RUN && state.step.mode.mode == MODE_IDLE;
        put_readings(&port, &record.sensors);
        port.clock_ms = record.clock_ms;
        port.link_out_size = 0;
        loop_tick(&parameters.config, &route, &state, starts ? MODE_START : MODE_NONE);
        if (memcmp(&state, &record, sizeof state) != 0 && differing++ == 0)
            first = records;
        records++;
    }
    printf("%d %d %d\n", records, differing, first);
    return 0;
}
