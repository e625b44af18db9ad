/* fmu.h: the plant as a co-simulation FMU, for any version of FMI. fmi2.c and fmi3.c implement the standard's functions
 * on top of this file.
 *
 * `brickpilot export fmu` writes the robot: a table with one row for each variable. A variable's index in the table is
 * its value reference. An instance uses no static variables, so that several may run at once, and no files.
 */
#ifndef BRICKPILOT_FMI_FMU_H
#define BRICKPILOT_FMI_FMU_H

#include <stdbool.h>
#include <stddef.h>

typedef enum {
    FMU_TIME,      /* s: the independent variable */
    FMU_VOLTAGE,   /* V: input of motor `index`; NaN: it floats, as with FMU_FLOATS */
    FMU_FLOATS,    /* boolean input of motor `index` */
    FMU_OUTPUT,    /* `index` in bp_output_name() */
    FMU_PARAMETER, /* `index` in bp_parameter() */
    FMU_EFFECT,    /* parameter `index` of the robot's effect `effect` */
    FMU_INITIAL,   /* double `index` of bp_state */
    FMU_STEP_LIMIT /* s; `index` 0: the motor step, 1: the body step */
} fmu_kind_t;

typedef struct {
    fmu_kind_t kind;
    const char *name;
    int effect; /* FMU_EFFECT alone: index in fmu_robot_t.effect */
    int index;
    double start;
} fmu_variable_t;

typedef struct {
    const char *token;
    int vehicle; /* BP_DIFF_DRIVE, BP_MOTOR or BP_SKID_STEER */
    int profile; /* BP_COUPLED or BP_PAPER */
    int effect_count;
    const char *const *effect; /* names, in the order of the table of effects */
    size_t variable_count;
    const fmu_variable_t *variable;
} fmu_robot_t;

/* The exported robot. The exporter writes it. */
extern const fmu_robot_t fmu_robot;

typedef struct fmu fmu_t;

/* A new instance with the robot's start values, or NULL: out of memory. */
fmu_t *fmu_new(void);
void fmu_free(fmu_t *fmu);

/* Restores the state of the instance after fmu_new(). */
void fmu_reset(fmu_t *fmu);

/* Why the last call failed: one line, valid until the next call. */
const char *fmu_message(const fmu_t *fmu);

/* Set or get the variable with this value reference; `boolean`: it is boolean, not real. Parameters and initial values
 * may be set until the initialisation ends, inputs at any time. Before that end, an output follows from the values set
 * so far. False: there is no such variable, it cannot be set now, or the values are outside their ranges. */
bool fmu_set(fmu_t *fmu, size_t reference, bool boolean, double value);
bool fmu_get(fmu_t *fmu, size_t reference, bool boolean, double *value);

/* Ends the initialisation at this time. False: a value is outside its range. */
bool fmu_begin(fmu_t *fmu, double time);

/* Advances from `time` by `step` seconds with the inputs held. False: the step is not positive and finite, the
 * simulation has not begun, or the state diverged. */
bool fmu_step(fmu_t *fmu, double time, double step);

/* The whole state, with the memories of the effects, in a copy of fmu_size() bytes. fmu_restore() accepts a copy only
 * from the same instance. */
size_t fmu_size(void);
void fmu_save(const fmu_t *fmu, void *copy);
void fmu_restore(fmu_t *fmu, const void *copy);

#endif
