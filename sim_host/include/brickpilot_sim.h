/* brickpilot_sim.h: the C interface of the plant. Python calls it through cffi, and so may any other program.
 *
 * A model is one vehicle: its nominal parameters and the effects that are switched on. Runs read a model and never
 * write it, so many runs, on many threads, may share one. All values are in SI units. The frame is the paper's: x
 * forward, y right, yaw clockwise positive. A function that returns int returns 0, or a BP_E_ code when it fails. cffi
 * reads this header unchanged, so it holds plain declarations only.
 */
#ifndef BRICKPILOT_SIM_H
#define BRICKPILOT_SIM_H

enum { BP_DIFF_DRIVE = 0, BP_MOTOR = 1, BP_SKID_STEER = 2 }; /* vehicle; a skid steer needs the profile coupled */
enum { BP_COUPLED = 0, BP_PAPER = 1 };                       /* profile */
enum { BP_E_NAME = -1, BP_E_RANGE = -2, BP_E_MEMORY = -3, BP_E_TIME = -4, BP_E_DIVERGED = -5 };
enum { BP_MAX_PARAMETERS = 192 }; /* most parameters of one effect */

typedef struct bp_model bp_model;

/* What a parameter is for. 0 means that the row states no role. */
enum {
    BP_ROLE_SIZE = 1, /* how large the effect is, or a physical value of the nominal model */
    BP_ROLE_SHAPE,    /* how the effect acts, not how strongly: a phase, a speed, a fraction */
    BP_ROLE_PLACE,    /* where the effect acts, on either side of 0 */
    BP_ROLE_SWITCH,   /* a choice between 0 and 1, which is never fitted */
    BP_ROLE_LIMIT,    /* the end of a range; `limits` names the signal that does not go beyond it */
    BP_ROLE_FIXED     /* a nominal parameter that is never fitted */
};

/* Prior: how often the simulator of a wheeled robot or a motor lacks this effect, judged before any data. 0 means that
 * the row states no prior. */
enum {
    BP_PRIOR_COMMON = 1, /* nearly every cheap geared robot has it, and plain simulators leave it out */
    BP_PRIOR_USUAL,      /* well known, on a part of the machines */
    BP_PRIOR_RARE        /* it takes a special machine, floor or set-up, or more speed than robots have */
};

/* One parameter of the nominal model or of an effect. The fields up to `odd` are set in every row; later fields are 0
 * or NULL if they do not apply.
 *
 * Three names of parameters mean the same in every effect: `order` (periods per turn of the wheel), `phase` (at wheel
 * angle 0) and `phase_difference` (left less right). A search for an effect with an `order` tries the orders that the
 * data show. */
typedef struct {
    const char *name;
    int role;                /* BP_ROLE_ */
    const char *unit;        /* SI unit; "1" if there is none */
    const char *linear_unit; /* the unit if the motor's input commands a force; NULL: the same unit */
    const char *meaning;
    double minimum; /* allowed range, ends included */
    double maximum;
    double preset; /* value if the caller gives none; for an effect, a size that shows clearly */
    int odd;       /* 1: its sign changes when left and right are swapped */

    int optional; /* 1: the effect also acts if this is 0; a fit tries it with the others and alone */
    double trial; /* size that a search tries if the preset is 0 */
    double
        scan_from;  /* first of the sizes that a search tries one by one, because the effect shows only at some sizes */
    double scan_to; /* last of these `scan_count` sizes; the ratio of neighbouring sizes is constant */
    int scan_count; /* number of these sizes; 0: none */
    const char *limits;    /* for BP_ROLE_LIMIT: the output that it limits, or "voltage" for the command */
    const char *arm_of;    /* name of the load whose lever arm this is; a fit varies the load and their product */
    const char *only_with; /* name of the parameter that this one adds to; alone, this one means nothing */
    const char
        *in_volts; /* for a torque at the wheel: name of the voltage torque * R / K_t, which calibrations report */
    int zero_if_unstated;  /* 1: this nominal parameter is taken as 0 if a data set does not give it */
    const char *variation; /* how the law differs if this is not 0, as words after "but": "by direction" */
    const char *mechanism; /* mechanism if only this parameter is not 0; NULL: the effect's mechanism */
    const char *same_as;   /* the nominal parameter that this one adds to: a model lacks this only if that is 0 */
    const char *says; /* meaning of a value above 0: a clause with {} for its size; NULL: use words, size and unit */
    const char *says_below; /* the same for a value below 0; NULL: never below 0, or left and right are exchanged */
    int over_mean;          /* 1: (left - right) / mean; texts say how much smaller the smaller side is */
    const char *run_value;  /* name of the value per run that adds to this parameter, such as "start"; NULL: none */
} bp_parameter_info;

/* One effect of the library. Every row sets all fields except the last nine; the composed effect has no advice.
 *
 * A mechanism has several laws, because the same part fails in more than one way. An effect is a variant if its law
 * differs in one respect from the law of a better known effect: `variant_of` names the better known effect, which has
 * the same mechanism and is not a variant itself. `variation` says what differs, as words after "but":
 * "battery_discharge, but by time". A verdict may name the right mechanism and the wrong law; then it says so.
 *
 * Law A contains law B if A becomes B when some parameters of A are 0, one period per turn or equal to each other, and
 * the others have B's values: stiction_stribeck without a breakaway is coulomb_friction, and cogging with one period
 * per turn is gravity_load. Parameters that cannot be 0 keep their presets, and the vehicle's own mass and inertia may
 * be adjusted: a load without weight, far out, moves only the centre of mass. The composed effect contains no law,
 * because it has no law until its terms are chosen.
 *
 * A law is made of other laws if it is their sum, each at its own size: friction in one direction only is
 * coulomb_friction plus a constant_offset. */
typedef struct {
    const char *name;
    const char *words;   /* a noun phrase: "The simulator lacks ..." */
    const char *summary; /* one sentence for a reader who does not know the name */
    const char
        *mechanism; /* supply, drive, timing, motor, gear, bearing, tyre, body, floor or sensor: the part to look at */
    const char *acts_on; /* supply, drive, motor, gear, wheel, body, sensor or timing: where in the equations */
    const char *equation;
    const char *source;
    int prior;                /* BP_PRIOR_ */
    const char *prior_reason; /* one sentence that says why, of this effect alone */
    const char *advice; /* one sentence on what to do; for an odd size above 0: left and right change places below 0 */
    int parameter_count;
    const bp_parameter_info *parameters;

    double motor_step;      /* s: the longest motor step that still resolves the effect; 0: no such limit */
    int carries_over;       /* 1: the charge or heat that one run leaves changes the next run */
    int composed;           /* 1: a sum of terms that discovery composes, never a candidate of its own */
    int shapeless;          /* 1: adds a constant to a reading, whatever moves: no shape of this law can be wrong */
    const char *variant_of; /* the effect of which this one is a variant; NULL: none */
    const char *variation;  /* what differs from that effect; NULL: none */
    const char *contains;   /* names of the effects whose laws this one contains, with spaces between; NULL: none */
    const char *made_of;    /* names of the effects whose sum is this law, with spaces between; NULL: none */
    const char *stated_by;  /* how a data set states the effect, at its presets. Sensors: a key of a rotation sensor's
                               channel. Drives: the beginning of the inputs' names. NULL: it cannot */
} bp_effect_info;

/* The tables of nominal parameters, effects and output columns. They return NULL beyond the last row. */
const bp_parameter_info *bp_parameter(int index);
const bp_effect_info *bp_effect(int index);
const char *bp_output_name(int index); /* as in data sets: "yaw_rate", ...; at the end "x", "y", "surge", "sway" */
const char *bp_output_unit(int index);

/* A model at its presets, without effects. The mass, wheel radius, rolling friction and air drag of a BP_MOTOR are 0
 * until they are set. NULL: out of memory, or no such vehicle in this profile. */
bp_model *bp_model_new(int vehicle, int profile);
bp_model *bp_model_copy(const bp_model *model);
void bp_model_free(bp_model *model);

/* Set or get one nominal parameter. BP_E_NAME: this vehicle has no such parameter. BP_E_RANGE: the value is outside
 * its range. */
int bp_model_set(bp_model *model, const char *parameter, double value);
int bp_model_get(const bp_model *model, const char *parameter, double *value);

/* Switches one effect on with parameter_count values in the order of its table. A second call replaces the values. */
int bp_model_add_effect(bp_model *model, const char *effect, const double *values);
int bp_model_remove_effect(bp_model *model, const char *effect);

/* The part of a model's effects that the firmware's compensation can undo, as physical quantities. [0] is left, [1]
 * right. Without effects each factor is 1 and everything else is 0. Each effect's own file says what it adds. */
typedef struct {
    double flux[2];           /* factor of the torque constant and the back-EMF constant */
    double rim[2];            /* factor of the wheel radius */
    double drive_gain[2];     /* factor of the voltage that arrives */
    double dry_torque[2];     /* N m: dry friction of a turning wheel */
    double root_torque[2];    /* N m at 1 rad/s: a loss that grows with the root of the wheel speed */
    double load[2];           /* N m: constant, against forward motion */
    double lost_voltage;      /* V that each drive loses, in either direction */
    double supply_resistance; /* ohm */
    double gyro_offset;       /* rad/s that the gyro reads at rest */
    double gyro_gain;         /* factor of the gyro's reading */
    double travel_gain;       /* factor of the rotation sensors' reading */
} bp_undoable;
void bp_model_undoable(const bp_model *model, bp_undoable *undoable);

/* The state that a run starts from and ends in. */
typedef struct {
    double x, y, heading;         /* m, m, rad */
    double surge, sway, yaw_rate; /* m/s, m/s, rad/s */
    double current[2];            /* A; left, right. A motor uses [0] alone, here and below */
    double wheel_speed[2];        /* rad/s; m/s for a linear motor */
    double wheel_angle[2];        /* rad; m for a linear motor */
    double age;                   /* s since power-on */
    double charge;                /* C drawn from the battery since power-on */
    double heat[2];               /* K of the windings above their surroundings; 0 where nothing heats */
    double rest; /* s: time at rest before the run, while the windings cool; 0 once the run has begun */
} bp_state;

/* From this sample on a run continues from another state: a restart divides two open-loop windows. The outputs at the
 * sample itself are still those of the previous window. If a field is NaN, the simulated value is kept. The memories of
 * the effects, such as commands that are still delayed, are also kept. If the wheel speeds are NaN, a coupled vehicle
 * gets them from surge and yaw_rate. */
typedef struct {
    int sample; /* 1 or more, increasing from restart to restart */
    bp_state state;
} bp_restart;

/* One free run: inputs in, outputs out. Sample k is the state at time[k]; input k acts from time[k] to time[k + 1]. */
typedef struct {
    const bp_model *model;
    int samples;         /* 1 or more */
    const double *time;  /* s, strictly increasing; `samples` times */
    const double *input; /* samples x 2 (left, right) V, or samples x 1 for a motor; NaN: the motor floats */
    bp_state initial;
    double motor_step; /* s, upper limit; 0: [rates] motor_step of models/rcx.toml */
    double body_step;  /* s, upper limit; 0: [rates] body_step */
    double
        *output; /* filled: samples x (number of output names), without noise; NaN: this vehicle has no such signal */
    const int *columns; /* NULL: all outputs, sample by sample. Else indices in bp_output_name(), output by output */
    int column_count;   /* of `columns` */
    bp_state final;     /* filled */
    int status;         /* filled: 0 or BP_E_ */

    int restart_count;
    const bp_restart *restart; /* array of restart_count; or NULL */
} bp_run;

/* Simulates `count` runs on up to `threads` threads. Returns 0, or the status of the first run that failed. The outputs
 * do not depend on the number of threads, not even in their last bit. */
int bp_simulate(bp_run *runs, int count, int threads);

/* Like bp_simulate(), with at most `lanes` runs side by side in vector registers: 1, 2, 4 or 8, or fewer if the
 * processor has fewer. bp_simulate() uses bp_lanes() lanes. The outputs do not depend on `lanes`, not even in the
 * last bit. Runs go side by side if they have the same sample times, longest steps, kind of vehicle and profile, and
 * tyres that do not slip; models, inputs and restarts may differ. */
int bp_simulate_lanes(bp_run *runs, int count, int threads, int lanes);
int bp_lanes(void);

/* One closed loop in this process: plant, sensors and the firmware. A control step lasts [rates] body_step of
 * models/rcx.toml. */
enum { BP_SENSORS_IDEAL = 0, BP_SENSORS_IMU = 1, BP_SENSORS_IMU_ENCODERS = 2 };
enum { BP_MAX_WAYPOINTS = 32, BP_MAX_COORDINATE_M = 30 }; /* limits of a route, from firmware/autopilot/route.h */

/* A setting of the firmware: its number in hal/wire/settings.toml, and the raw integer that the firmware holds. */
typedef struct {
    int number;
    int raw;
} bp_setting;

/* The robot's sensors: [sensors.*] of a vehicle file. A range limits both signs. */
typedef struct {
    double accel_noise_sd, accel_range, accel_bias_surge, accel_bias_sway; /* m/s^2 */
    double gyro_noise_sd, gyro_range, gyro_bias;                           /* rad/s */
    int bits;                  /* bits of the converter, for all three axes; 0: readings are not rounded */
    double counts_per_turn;    /* of a wheel, above 0 */
    double battery_resolution; /* V, above 0 */
} bp_devices;

typedef struct {
    const bp_model *model;   /* of any vehicle but a BP_MOTOR */
    int controller;          /* BP_COUPLED or BP_PAPER: the firmware's set of constants */
    int sensors;             /* BP_SENSORS_ */
    unsigned long long seed; /* seed of the sensors' noise */
    bp_state initial;
    double motor_step;       /* s, upper limit; 0: [rates] motor_step of models/rcx.toml */
    int steps;               /* control steps */
    int start_step;          /* the step at which the mission is commanded to start */
    int waypoint_count;      /* 1..BP_MAX_WAYPOINTS; 0 if `drive` is not NULL */
    const double *waypoints; /* waypoint_count x 2, m, up to BP_MAX_COORDINATE_M in size */
    double cruise;           /* m/s, up to 2; 0: the firmware's preset */
    const double *drive;     /* a manoeuvre, without the controller: steps x 2 V (NaN: floats); else NULL */
    double stop_path;        /* m of path after which a manoeuvre shorts both motors; 0: never */
    double *log;             /* steps x (number of log names), filled; or NULL */
    short *motors;           /* steps x 2 duty_q15, filled; or NULL */
    int status;              /* filled: 0 or BP_E_ */

    const bp_setting *settings; /* array of setting_count, written before the flight; or NULL */
    int setting_count;
    const bp_devices *devices; /* NULL: the sensors of models/rcx.toml */

    const int *columns; /* NULL: `log` has all columns, step by step. Else indices in bp_log_name(), column by column */
    int column_count;   /* of `columns` */

    const bp_model *later; /* the model from step `later_step` on, of the same vehicle and profile; NULL: `model` */
    int later_step;        /* the state goes on, and the memories of effects, such as delayed commands, begin anew */
} bp_flight;

const char *bp_log_name(int index); /* "time_s", "true_x_m", ...; NULL beyond the last */

/* Flies and returns flight->status. BP_E_RANGE: a value outside the range of its field, a vehicle of another kind, or a
 * route that the firmware refuses. The same seed gives the same bytes. */
int bp_fly(bp_flight *flight);

/* Flies `count` flights. Each gets the same bytes and status as from bp_fly() alone. Neighbouring flights
 * with the same number of steps, vehicle, profile and motor_step advance side by side in up to `lanes` lanes of vector
 * registers (bp_simulate_lanes()), which takes less time. Returns 0, or the status of the first flight that failed. */
int bp_fly_many(bp_flight *flights, int count, int lanes);

/* Returns the size in bytes of all plants that can fly side by side. If two libraries that share a plant (run/build)
 * return different numbers, they were compiled from different plants. */
int bp_plant_size(void);

/* The same loop with its controller outside: the caller carries the readings to the controller, and the motor commands
 * back. The request is that of bp_fly() for a mission. Its arrays are filled in the same way, except that the
 * controller's columns of the log are 0. The loop ignores controller, start_step, cruise and settings. */
typedef struct bp_loop bp_loop;

/* The readings of one step in the formats of hal/include/hal.h. A status is 0 (ok), 1 (absent) or 2 (stale). */
typedef struct {
    unsigned int time_ms;
    int imu_status, rotation_status, battery_status, reference_status;
    short accel_surge_mm_s2, accel_sway_mm_s2, yaw_rate_mrad_s;
    unsigned short rotation_left, rotation_right, battery_mv;
    int x_um, y_um;
    unsigned short heading_bam16;
    short speed_mm_s_q4, true_yaw_rate_mrad_s;
} bp_sensed;

/* Opens a loop. NULL: `status` holds the BP_E_ code. The request's model and arrays must outlive the loop. */
bp_loop *bp_loop_open(const bp_flight *request, int *status);
void bp_loop_close(bp_loop *loop);

/* Reads the sensors, with their noise. Call it once per step. */
void bp_loop_sense(bp_loop *loop, bp_sensed *sensed);

/* Applies this duty (32767 = 1) to the motors for one control step. BP_E_RANGE: the last step is over. */
int bp_loop_act(bp_loop *loop, short left_q15, short right_q15);

#endif
