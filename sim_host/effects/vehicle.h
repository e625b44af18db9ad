/* vehicle.h: what the plant and its effects share: names of parameters and outputs, the state, and the working values
 * of a step.
 *
 * SI units. Frame of the paper: x forward, y right, yaw clockwise from above. [0] is left, [1] right; a BP_MOTOR has
 * [0] alone, and where its input commands force its "torques" are N and its "speeds" m/s.
 */
#ifndef BRICKPILOT_EFFECTS_VEHICLE_H
#define BRICKPILOT_EFFECTS_VEHICLE_H

#include "brickpilot_sim.h"

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
    PARAMETER_COUNT
} parameter_t;

/* Index into an output row; the order of bp_output_name(). What a vehicle does not have is NaN. */
typedef enum {
    OUTPUT_ACCEL_SURGE, /* mean specific force at the middle of the axle, where the centre of mass nominally is, over
                           the last body step: u' - v r */
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
    OUTPUT_SPEED, /* from here to OUTPUT_FORCE: a motor's */
    OUTPUT_ANGLE,
    OUTPUT_POSITION,
    OUTPUT_VELOCITY,
    OUTPUT_CURRENT,
    OUTPUT_FORCE, /* of the motor on its load: torque over wheel radius, or what the input commands */
    OUTPUT_X,
    OUTPUT_Y,
    OUTPUT_SURGE,
    OUTPUT_SWAY,
    OUTPUT_COUNT
} output_t;

/* Contact of the tyres in one direction. Slip speed = creep F for small forces; F never exceeds `friction` times the
 * load. */
typedef struct {
    double creep;    /* m/s per N; 0: the tyres do not slip this way */
    double friction; /* 1 */
} tyre_t;

/* What the vehicle is made of. */
typedef struct {
    double mass;
    double yaw_inertia; /* about the centre of mass */
    double com_forward; /* m: centre of mass from the middle of the axle */
    double com_right;   /* m */
    double rim[2];      /* radius of either wheel over wheel_radius */
    tyre_t along;       /* each wheel's rolling; coupled profile only */
    tyre_t across;      /* both wheels' side force together; coupled profile only */
} build_t;

/* Dry friction: a bound on the friction that opposes one motion and holds it at zero. */
typedef enum {
    DRY_LEFT,  /* left wheel's turning, N m; a motor's, N m or N */
    DRY_RIGHT, /* right wheel's turning, N m */
    DRY_SURGE, /* the body's surge, N */
    DRY_YAW,   /* the body's yaw, N m */
    DRY_COUNT
} dry_t;

/* One motor, seen at the wheel. */
typedef struct {
    double resistance;      /* ohm */
    double inductance;      /* H; 0: the current follows the voltage at once */
    double torque_constant; /* N m/A */
    double emf_constant;    /* V s/rad */
    double torque_per_volt; /* N m/V, or N/V: a drive that closes its own current loop; then torque_constant is 0 */
    double inertia;         /* kg m^2, or kg: wheel and rotor, without the vehicle's mass */
    double drag;            /* N m s/rad, or N s/m: all losses linear in the speed */
} motor_t;

typedef struct {
    /* State. Hooks read it, and motor_heating writes `heat`. */
    bp_state state;
    double accel_surge; /* mean specific force over the last body step */
    double accel_sway;
    double surge_rate; /* u', v', r': mean over the last body step */
    double sway_rate;
    double yaw_accel;
    double supply_current; /* A, mean over the last body step: what the drive drew from the battery */
    double step; /* s: motor step in timing, drive and wheel hooks; body step in the others (0 before the first) */
    const double *parameter;
    int vehicle; /* BP_DIFF_DRIVE or BP_MOTOR */
    int profile;

    /* Body hooks read it: where the state will be half a body step ahead, extrapolated. */
    struct {
        double surge, sway, yaw_rate, heading;
    } middle;

    build_t build; /* build hooks change it, the others read it */

    /* Working values. The plant sets them to the nominal ones, then the hooks of the site change them. */
    double command[2];           /* timing: V; NaN floats */
    double supply;               /* supply: V at the drive; commands scale with supply / battery_voltage */
    double voltage[2];           /* drive: V at the motor; NaN floats */
    motor_t motor[2];            /* motor */
    double wheel_torque[2];      /* wheel: N m driving forward, beside the motor's; starts at 0 */
    double dry[DRY_COUNT];       /* wheel: bounds; several effects add theirs; starts at 0 */
    double force_surge;          /* body: N forward, at the middle of the axle; starts at 0 */
    double force_sway;           /* body: N to the right; not felt while coupled wheels do not slide; starts at 0 */
    double moment_yaw;           /* body: N m clockwise, about the middle of the axle; starts at 0 */
    double drag_surge;           /* body: N s/m, times surge; starts at the air drag's */
    double drag_sway;            /* body: N s/m, times sway; starts at the air drag's */
    double drag_yaw;             /* body: N m s/rad, times yaw rate; starts at 0 */
    double output[OUTPUT_COUNT]; /* sensor: what the sensors see, of the state just reached */
} vehicle_t;

#endif
