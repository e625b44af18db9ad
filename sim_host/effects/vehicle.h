/* vehicle.h: data that the plant and its effects share: the names of parameters and outputs, the state, and the working
 * values of a step.
 *
 * SI units, and the paper's frame: x forward, y right, yaw clockwise seen from above. [0] is left and [1] is right. A
 * BP_MOTOR has only [0]; if its input commands a force, its "torques" are in N and its "speeds" in m/s.
 */
#ifndef BRICKPILOT_EFFECTS_VEHICLE_H
#define BRICKPILOT_EFFECTS_VEHICLE_H

#include "brickpilot_sim.h"
#include "effects/real.h"

/* Index into vehicle_t.parameter; the order of bp_parameter(). */
typedef enum {
    PARAMETER_MASS,
    PARAMETER_YAW_INERTIA,
    PARAMETER_HALF_TRACK,
    PARAMETER_WHEEL_RADIUS,
    PARAMETER_WHEEL_INERTIA,
    PARAMETER_RESISTANCE,
    PARAMETER_INDUCTANCE,
    PARAMETER_EMF_CONSTANT,
    PARAMETER_TORQUE_CONSTANT,
    PARAMETER_VISCOUS_FRICTION,
    PARAMETER_ROLLING_FRICTION,
    PARAMETER_DRAG_AREA,
    PARAMETER_AIR_DENSITY,
    PARAMETER_GRAVITY,
    PARAMETER_BATTERY_VOLTAGE,
    PARAMETER_STALL_TORQUE,
    PARAMETER_NO_LOAD_SPEED,
    PARAMETER_FORCE_PER_VOLT,
    PARAMETER_TORQUE_PER_VOLT,
    PARAMETER_WHEELBASE,
    PARAMETER_CONTACT_FRICTION,
    PARAMETER_SLIP_SPEED,
    PARAMETER_COUNT
} parameter_t;

/* Index into an output row; the order of bp_output_name(). An output that this vehicle does not have is NaN. */
typedef enum {
    OUTPUT_ACCEL_SURGE, /* specific force u' - v r at the middle of the axle, where the centre of mass nominally is: the
                           mean since the last reading; in sensor hooks, the mean over the last body step */
    OUTPUT_ACCEL_SWAY,  /* v' + u r */
    OUTPUT_YAW_RATE,
    OUTPUT_YAW_ANGLE, /* unwrapped */
    OUTPUT_WHEEL_SPEED_LEFT,
    OUTPUT_WHEEL_SPEED_RIGHT,
    OUTPUT_WHEEL_ANGLE_LEFT,
    OUTPUT_WHEEL_ANGLE_RIGHT,
    OUTPUT_WHEEL_TRAVEL_LEFT, /* angle times radius */
    OUTPUT_WHEEL_TRAVEL_RIGHT,
    OUTPUT_WHEEL_VELOCITY_LEFT,
    OUTPUT_WHEEL_VELOCITY_RIGHT,
    OUTPUT_CURRENT_LEFT,
    OUTPUT_CURRENT_RIGHT,
    OUTPUT_BATTERY_VOLTAGE,
    OUTPUT_SPEED, /* from here to OUTPUT_FORCE: outputs of a motor */
    OUTPUT_ANGLE,
    OUTPUT_POSITION,
    OUTPUT_VELOCITY,
    OUTPUT_CURRENT,
    OUTPUT_FORCE, /* of the motor on its load: torque over wheel radius, or the force that the input commands */
    OUTPUT_X,
    OUTPUT_Y,
    OUTPUT_SURGE,
    OUTPUT_SWAY,
    OUTPUT_COUNT
} output_t;

/* The tyres' law in one direction. For small forces F the slip speed is creep * F; F never exceeds friction * load. */
typedef struct {
    real_t creep;    /* m/s per N; 0: the tyres do not slip this way */
    real_t friction; /* friction coefficient, unit 1 */
} tyre_t;

/* Masses and geometry of the vehicle, with the effects applied. */
typedef struct {
    real_t mass;
    real_t yaw_inertia; /* about the centre of mass */
    real_t com_forward; /* m: centre of mass ahead of the middle of the axle */
    real_t com_right;   /* m: centre of mass to the right of the middle of the axle */
    real_t rim[2];      /* ratio of each wheel's radius to wheel_radius */
    tyre_t along;       /* slip of each wheel along the track; coupled profile only */
    tyre_t across;      /* sideways slip of both wheels together; coupled profile only */
    real_t one_circle;  /* 1: `along` is the law of each wheel, in every direction of its slip */
} build_t;

/* Dry friction is a bound: the largest force or torque that opposes a motion or holds it at zero, for each motion. */
typedef enum {
    DRY_LEFT,  /* turning of the left wheel, N m; of a motor, N m or N */
    DRY_RIGHT, /* turning of the right wheel, N m */
    DRY_SURGE, /* surge of the body, N */
    DRY_YAW,   /* yaw of the body, N m */
    DRY_COUNT
} dry_t;

/* One motor, with all values referred to the wheel. */
typedef struct {
    real_t resistance;      /* ohm */
    real_t inductance;      /* H; 0: the current follows the voltage at once */
    real_t torque_constant; /* N m/A */
    real_t emf_constant;    /* V s/rad */
    real_t torque_per_volt; /* N m/V, or N/V: of a drive with its own current loop; then torque_constant is 0 */
    real_t inertia;         /* kg m^2, or kg: wheel and rotor, without the vehicle's mass */
    real_t drag;            /* N m s/rad, or N s/m: all losses that are linear in the speed */
} motor_t;

/* One bp_state for each robot. */
#if LANES == 1
typedef bp_state state_t;
#else
typedef struct {
    real_t x, y, heading, surge, sway, yaw_rate, current[2], wheel_speed[2], wheel_angle[2], age, charge, heat[2], rest;
} state_t;
#endif

/* The struct begins with numbers only, so that a number has the same index for one robot and for several. */
typedef struct {
    /* State. Hooks may read all of it, and may write only the windings' `heat`. */
    state_t state;
    real_t accel_surge; /* mean specific force over the last body step */
    real_t accel_sway;
    real_t surge_rate; /* u', v' and r': means over the last body step */
    real_t sway_rate;
    real_t yaw_accel;
    real_t supply_current; /* A that the drive drew from the battery: mean over the last body step */
    real_t felt[2];        /* readings of the accelerometers, surge and sway: means over the body steps of a sample */

    /* For body hooks: the state half a body step ahead, extrapolated. */
    struct {
        real_t surge, sway, yaw_rate, heading;
    } middle;

    /* Working values. The plant sets those of the nominal model; then the hooks of the site named here change them. */
    real_t force_surge;     /* body: N forward, at the middle of the axle; starts at 0 */
    real_t force_sway;      /* body: N to the right; no effect while coupled wheels do not slide; starts at 0 */
    real_t moment_yaw;      /* body: N m clockwise, about the middle of the axle; starts at 0 */
    real_t drag_surge;      /* body: N s/m, times surge; starts at the air drag */
    real_t drag_sway;       /* body: N s/m, times sway; starts at the air drag */
    real_t drag_yaw;        /* body: N m s/rad, times yaw rate; starts at 0 */
    real_t step;            /* s: the motor step in timing, drive and wheel hooks; the body step in others (0 before the
                               first) */
    real_t command[2];      /* timing: V; NaN: the motor floats */
    real_t supply;          /* supply: V at the drive; commands scale with supply / battery_voltage */
    real_t voltage[2];      /* drive: V at the motor; NaN: it floats */
    real_t wheel_torque[2]; /* wheel: N m forward, in addition to the motor's torque; starts at 0 */
    real_t dry[DRY_COUNT];  /* wheel: sums of the effects' bounds; start at 0 */
    motor_t motor[2];       /* motor: both motors */

    build_t build;               /* build hooks change it, other hooks read it */
    real_t output[OUTPUT_COUNT]; /* sensor: readings of the state just reached, without noise */

    const real_t *parameter;
    int vehicle; /* BP_DIFF_DRIVE, BP_MOTOR or BP_SKID_STEER */
    int profile;
} vehicle_t;

/* Number of wheels, which is also the number of motors. */
static inline int vehicle_wheels(const vehicle_t *vehicle)
{
    return vehicle->vehicle == BP_MOTOR ? 1 : 2;
}

/* Limits a supply voltage, as effects have changed it, to at least 1 % of the battery's nominal voltage, so that a
 * command divided by the supply stays finite. */
static inline real_t vehicle_supply_of(const vehicle_t *vehicle, real_t voltage)
{
    const real_t least = 0.01 * vehicle->parameter[PARAMETER_BATTERY_VOLTAGE];
    return choose(voltage > least, voltage, least);
}

#endif
