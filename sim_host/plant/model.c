#include "plant/model.h"

#include <stdlib.h>
#include <string.h>

#include "models/rcx_gen.h"

static const bp_parameter_info PARAMETER[PARAMETER_COUNT] = {
    [PARAMETER_MASS] = {"mass", "kg", "whole vehicle; of a motor: its load", 1e-3, 1e5, RCX_MASS, 0},
    [PARAMETER_YAW_INERTIA] = {"yaw_inertia", "kg m^2", "J_z about the centre of mass", 1e-7, 1e5, RCX_YAW_INERTIA, 0},
    [PARAMETER_HALF_TRACK] = {"half_track", "m", "wheel to centre line", 1e-3, 10, RCX_HALF_TRACK, 0},
    [PARAMETER_WHEEL_RADIUS] = {"wheel_radius", "m", "r_w; of a motor: travel of its load per rad", 1e-4, 10,
                                RCX_WHEEL_RADIUS, 0},
    [PARAMETER_WHEEL_INERTIA] = {"wheel_inertia", "kg m^2", "J per side, rotor included, at the wheel", 1e-9, 1e4,
                                 RCX_WHEEL_INERTIA, 0},
    [PARAMETER_RESISTANCE] = {"resistance", "ohm", "R of eq. 12", 1e-4, 1e5, RCX_RESISTANCE, 0},
    [PARAMETER_INDUCTANCE] = {"inductance", "H", "L of eq. 12", 0, 10, RCX_INDUCTANCE, 0},
    [PARAMETER_EMF_CONSTANT] = {"emf_constant", "V s/rad", "K_e, at the wheel", 0, 1e4, RCX_EMF_CONSTANT, 0},
    [PARAMETER_TORQUE_CONSTANT] = {"torque_constant", "N m/A", "K_t, at the wheel", 0, 1e4, RCX_TORQUE_CONSTANT, 0},
    [PARAMETER_VISCOUS_FRICTION] = {"viscous_friction", "N m s/rad",
                                    "b_s per side; N s/m where the input commands force", 0, 1e5, RCX_VISCOUS_FRICTION,
                                    0},
    [PARAMETER_ROLLING_FRICTION] = {"rolling_friction", "s/m", "sigma of eq. 13", 0, 10, RCX_ROLLING_FRICTION, 0},
    [PARAMETER_DRAG_AREA] = {"drag_area", "m^2", "C_d A of eq. 5", 0, 100, RCX_DRAG_AREA, 0},
    [PARAMETER_AIR_DENSITY] = {"air_density", "kg/m^3", "rho of eq. 5", 0, 10, RCX_AIR_DENSITY, 0},
    [PARAMETER_GRAVITY] = {"gravity", "m/s^2", "g of eq. 13", 0, 30, RCX_GRAVITY, 0},
    [PARAMETER_BATTERY_VOLTAGE] = {"battery_voltage", "V", "V_max of eq. 17", 0.1, 1000, RCX_BATTERY_VOLTAGE, 0},
    [PARAMETER_STALL_TORQUE] = {"stall_torque", "N m", "T_stall of eq. 16, paper profile only", 1e-6, 1e4,
                                RCX_STALL_TORQUE, 0},
    [PARAMETER_NO_LOAD_SPEED] = {"no_load_speed", "rad/s", "w_absmax of eq. 16, paper profile only", 1e-3, 1e5,
                                 RCX_NO_LOAD_SPEED, 0},
    [PARAMETER_FORCE_PER_VOLT] = {"force_per_volt", "N/V", "of a motor whose input commands force; 0: it does not", 0,
                                  1e5, 0, 0},
    [PARAMETER_TORQUE_PER_VOLT] = {"torque_per_volt", "N m/V", "of a motor whose input commands torque; 0: it does not",
                                   0, 1e5, 0, 0},
};

/* What a bare motor lacks: 0 until someone sets it. */
static const parameter_t OF_A_VEHICLE[] = {PARAMETER_MASS, PARAMETER_WHEEL_RADIUS, PARAMETER_ROLLING_FRICTION,
                                           PARAMETER_DRAG_AREA};

const bp_parameter_info *bp_parameter(int index)
{
    return index < 0 || index >= PARAMETER_COUNT ? NULL : &PARAMETER[index];
}

static int parameter_index(const char *name)
{
    for (int i = 0; i < PARAMETER_COUNT; i++)
        if (strcmp(PARAMETER[i].name, name) == 0)
            return i;
    return -1;
}

bp_model *bp_model_new(int vehicle, int profile)
{
    if ((vehicle != BP_DIFF_DRIVE && vehicle != BP_MOTOR) || (profile != BP_COUPLED && profile != BP_PAPER))
        return NULL;
    bp_model *model = calloc(1, sizeof *model);
    if (model == NULL)
        return NULL;
    model->vehicle = vehicle;
    model->profile = profile;
    for (int i = 0; i < PARAMETER_COUNT; i++)
        model->parameter[i] = PARAMETER[i].preset;
    if (vehicle == BP_MOTOR)
        for (size_t i = 0; i < sizeof OF_A_VEHICLE / sizeof OF_A_VEHICLE[0]; i++)
            model->parameter[OF_A_VEHICLE[i]] = 0;
    return model;
}

bp_model *bp_model_copy(const bp_model *model)
{
    bp_model *copy = malloc(sizeof *copy);
    if (copy != NULL)
        *copy = *model;
    return copy;
}

void bp_model_free(bp_model *model)
{
    free(model);
}

static int in_range(const bp_parameter_info *info, double value)
{
    return value >= info->minimum && value <= info->maximum;
}

/* A motor may be without a load (mass, radius) and without an inertia of its own. */
static int may_be_absent(const bp_model *model, int parameter)
{
    return model->vehicle == BP_MOTOR &&
           (parameter == PARAMETER_MASS || parameter == PARAMETER_WHEEL_RADIUS || parameter == PARAMETER_WHEEL_INERTIA);
}

int bp_model_set(bp_model *model, const char *parameter, double value)
{
    const int index = parameter_index(parameter);
    if (index < 0)
        return BP_E_NAME;
    if (!in_range(&PARAMETER[index], value) && !(value == 0 && may_be_absent(model, index)))
        return BP_E_RANGE;
    model->parameter[index] = value;
    return 0;
}

int bp_model_get(const bp_model *model, const char *parameter, double *value)
{
    const int index = parameter_index(parameter);
    if (index < 0)
        return BP_E_NAME;
    *value = model->parameter[index];
    return 0;
}

int bp_model_remove_effect(bp_model *model, const char *effect)
{
    for (int i = 0; i < model->effect_count; i++) {
        if (strcmp(model->effect[i].effect->info.name, effect) != 0)
            continue;
        model->effect_count--;
        memmove(&model->effect[i], &model->effect[i + 1], (size_t)(model->effect_count - i) * sizeof model->effect[0]);
        return 0;
    }
    return BP_E_NAME;
}

static int memory_in_use(const bp_model *model)
{
    int sum = 0;
    for (int i = 0; i < model->effect_count; i++)
        sum += model->effect[i].effect->memory_count;
    return sum;
}

int bp_model_add_effect(bp_model *model, const char *effect, const double *values)
{
    const int index = effect_index(effect);
    if (index < 0)
        return BP_E_NAME;
    const effect_t *row = effect_at(index);
    for (int i = 0; i < row->info.parameter_count; i++)
        if (!in_range(&row->info.parameters[i], values[i]))
            return BP_E_RANGE;

    (void)bp_model_remove_effect(model, effect);
    if (model->effect_count == MODEL_EFFECTS || memory_in_use(model) + row->memory_count > EFFECT_MEMORY)
        return BP_E_MEMORY;
    int at = model->effect_count;
    while (at > 0 && effect_index(model->effect[at - 1].effect->info.name) > index)
        at--;
    memmove(&model->effect[at + 1], &model->effect[at], (size_t)(model->effect_count - at) * sizeof model->effect[0]);
    model->effect[at].effect = row;
    memset(model->effect[at].value, 0, sizeof model->effect[at].value);
    if (row->info.parameter_count > 0)
        memcpy(model->effect[at].value, values, (size_t)row->info.parameter_count * sizeof values[0]);
    model->effect_count++;
    return 0;
}
