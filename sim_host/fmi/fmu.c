#include "fmi/fmu.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "brickpilot_sim.h"
#include "plant/model.h"
#include "plant/plant.h"

enum { MESSAGE_SIZE = 256, MOTORS = 2, STEP_LIMITS = 2, STATE_VALUES = sizeof(bp_state) / sizeof(double) };

struct fmu {
    bool begun;      /* the initialisation is over */
    bool up_to_date; /* the plant has been started with the present values */
    double time;
    struct bp_model model; /* the plant's model; the plant points to it */
    plant_t plant;
    double output[OUTPUT_COUNT];
    char message[MESSAGE_SIZE];
    double value[]; /* value of each variable that can be set */
};

size_t fmu_size(void)
{
    return sizeof(fmu_t) + fmu_robot.variable_count * sizeof(double);
}

fmu_t *fmu_new(void)
{
    fmu_t *fmu = malloc(fmu_size());
    if (fmu != NULL)
        fmu_reset(fmu);
    return fmu;
}

void fmu_free(fmu_t *fmu)
{
    free(fmu);
}

void fmu_reset(fmu_t *fmu)
{
    memset(fmu, 0, fmu_size());
    for (size_t i = 0; i < fmu_robot.variable_count; i++)
        fmu->value[i] = fmu_robot.variable[i].start;
}

const char *fmu_message(const fmu_t *fmu)
{
    return fmu->message;
}

static bool refuse(fmu_t *fmu, const char *name, const char *why)
{
    (void)snprintf(fmu->message, sizeof fmu->message, "%s: %s", name, why);
    return false;
}

static bool refuse_value(fmu_t *fmu, const char *name, double value, const bp_parameter_info *info)
{
    (void)snprintf(fmu->message, sizeof fmu->message, "%s: %g is outside %g..%g %s", name, value, info->minimum,
                   info->maximum, info->unit);
    return false;
}

static bool set_parameters(fmu_t *fmu, bp_model *model)
{
    for (size_t i = 0; i < fmu_robot.variable_count; i++) {
        const fmu_variable_t *variable = &fmu_robot.variable[i];
        if (variable->kind != FMU_PARAMETER)
            continue;
        const bp_parameter_info *info = bp_parameter(variable->index);
        if (bp_model_set(model, info->name, fmu->value[i]) != 0)
            return refuse_value(fmu, variable->name, fmu->value[i], info);
    }
    return true;
}

static bool in_range(const bp_parameter_info *info, double value)
{
    return value >= info->minimum && value <= info->maximum;
}

static bool add_effect(fmu_t *fmu, bp_model *model, int effect)
{
    const char *name = fmu_robot.effect[effect];
    const effect_t *row = effect_at(effect_index(name));
    double values[BP_MAX_PARAMETERS] = {0};
    for (size_t i = 0; i < fmu_robot.variable_count; i++) {
        const fmu_variable_t *variable = &fmu_robot.variable[i];
        if (variable->kind != FMU_EFFECT || variable->effect != effect)
            continue;
        const bp_parameter_info *info = &row->info.parameters[variable->index];
        values[variable->index] = fmu->value[i];
        if (!in_range(info, fmu->value[i]))
            return refuse_value(fmu, variable->name, fmu->value[i], info);
    }
    return bp_model_add_effect(model, name, values) == 0 || refuse(fmu, name, "there are too many effects");
}

static bool build(fmu_t *fmu, bp_model *model)
{
    if (model == NULL)
        return refuse(fmu, "memory", "there is not enough");
    if (!set_parameters(fmu, model))
        return false;
    for (int i = 0; i < fmu_robot.effect_count; i++)
        if (!add_effect(fmu, model, i))
            return false;
    fmu->model = *model;
    return true;
}

static bool start(fmu_t *fmu)
{
    double state[STATE_VALUES] = {0};
    double limit[STEP_LIMITS] = {0};
    for (size_t i = 0; i < fmu_robot.variable_count; i++) {
        const fmu_variable_t *variable = &fmu_robot.variable[i];
        if (variable->kind == FMU_INITIAL)
            state[variable->index] = fmu->value[i];
        else if (variable->kind == FMU_STEP_LIMIT)
            limit[variable->index] = fmu->value[i];
    }
    bp_state initial;
    memcpy(&initial, state, sizeof initial);
    if (plant_start(&fmu->plant, &fmu->model, &initial, limit[0], limit[1]) != 0)
        return refuse(fmu, "initial", "a value is not finite, a step limit is negative, or nothing has an inertia");
    return true;
}

/* Starts the plant with the present values, unless it has been started with them. */
static bool prepare(fmu_t *fmu)
{
    if (fmu->up_to_date)
        return true;
    bp_model *model = bp_model_new(fmu_robot.vehicle, fmu_robot.profile);
    fmu->up_to_date = build(fmu, model) && start(fmu);
    bp_model_free(model);
    if (fmu->up_to_date)
        plant_outputs(&fmu->plant, fmu->output);
    return fmu->up_to_date;
}

static const fmu_variable_t *variable_at(fmu_t *fmu, size_t reference, bool boolean)
{
    if (reference < fmu_robot.variable_count && (fmu_robot.variable[reference].kind == FMU_FLOATS) == boolean)
        return &fmu_robot.variable[reference];
    (void)snprintf(fmu->message, sizeof fmu->message, "value reference %zu: there is no %s variable with it", reference,
                   boolean ? "boolean" : "real");
    return NULL;
}

bool fmu_set(fmu_t *fmu, size_t reference, bool boolean, double value)
{
    const fmu_variable_t *variable = variable_at(fmu, reference, boolean);
    if (variable == NULL)
        return false;
    if (variable->kind == FMU_TIME || variable->kind == FMU_OUTPUT)
        return refuse(fmu, variable->name, "cannot be set, since it is computed");
    if (variable->kind == FMU_VOLTAGE && isinf(value))
        return refuse(fmu, variable->name, "is infinite; NaN lets the motor float");
    if (variable->kind != FMU_VOLTAGE && variable->kind != FMU_FLOATS) {
        if (fmu->begun)
            return refuse(fmu, variable->name, "can be set until the initialisation ends, and not later");
        fmu->up_to_date = false;
    }
    fmu->value[reference] = value;
    return true;
}

bool fmu_get(fmu_t *fmu, size_t reference, bool boolean, double *value)
{
    const fmu_variable_t *variable = variable_at(fmu, reference, boolean);
    if (variable == NULL || (variable->kind == FMU_OUTPUT && !prepare(fmu)))
        return false;
    if (variable->kind == FMU_TIME)
        *value = fmu->time;
    else
        *value = variable->kind == FMU_OUTPUT ? fmu->output[variable->index] : fmu->value[reference];
    return true;
}

bool fmu_begin(fmu_t *fmu, double time)
{
    if (!prepare(fmu))
        return false;
    fmu->time = time;
    fmu->begun = true;
    return true;
}

static void read_inputs(const fmu_t *fmu, double input[MOTORS])
{
    bool floats[MOTORS] = {false};
    input[0] = input[1] = 0;
    for (size_t i = 0; i < fmu_robot.variable_count; i++) {
        const fmu_variable_t *variable = &fmu_robot.variable[i];
        if (variable->kind == FMU_VOLTAGE)
            input[variable->index] = fmu->value[i];
        else if (variable->kind == FMU_FLOATS)
            floats[variable->index] = fmu->value[i] != 0;
    }
    for (int k = 0; k < MOTORS; k++)
        if (floats[k])
            input[k] = NAN;
}

bool fmu_step(fmu_t *fmu, double time, double step)
{
    double input[MOTORS];
    if (!fmu->begun)
        return refuse(fmu, "step", "the initialisation has not ended");
    read_inputs(fmu, input);
    const int status = plant_advance(&fmu->plant, input, step);
    if (status == BP_E_TIME)
        return refuse(fmu, "step", "it is not positive and finite, or has more than 1e9 steps of the plant");
    if (status != 0)
        return refuse(fmu, "step", "the state diverged");
    plant_outputs(&fmu->plant, fmu->output);
    fmu->time = time + step;
    return true;
}

void fmu_save(const fmu_t *fmu, void *copy)
{
    memcpy(copy, fmu, fmu_size());
}

void fmu_restore(fmu_t *fmu, const void *copy)
{
    memcpy(fmu, copy, fmu_size());
}
