#include "plant/model.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "models/rcx_gen.h"

static const bp_parameter_info PARAMETER[PARAMETER_COUNT] = {
    [PARAMETER_MASS] = {.name = "mass",
                        .role = BP_ROLE_SIZE,
                        .unit = "kg",
                        .meaning = "mass of the whole vehicle; of a motor: of its load",
                        .minimum = 1e-3,
                        .maximum = 1e5,
                        .preset = RCX_MASS},
    [PARAMETER_YAW_INERTIA] = {.name = "yaw_inertia",
                               .role = BP_ROLE_SIZE,
                               .unit = "kg m^2",
                               .meaning = "J_z, about the centre of mass",
                               .minimum = 1e-7,
                               .maximum = 1e5,
                               .preset = RCX_YAW_INERTIA},
    [PARAMETER_HALF_TRACK] = {.name = "half_track",
                              .role = BP_ROLE_SIZE,
                              .unit = "m",
                              .meaning = "distance from a wheel to the centre line",
                              .minimum = 1e-3,
                              .maximum = 10,
                              .preset = RCX_HALF_TRACK},
    [PARAMETER_WHEEL_RADIUS] = {.name = "wheel_radius",
                                .role = BP_ROLE_SIZE,
                                .unit = "m",
                                .meaning = "r_w; of a motor: travel of its load per rad",
                                .minimum = 1e-4,
                                .maximum = 10,
                                .preset = RCX_WHEEL_RADIUS},
    [PARAMETER_WHEEL_INERTIA] = {.name = "wheel_inertia",
                                 .role = BP_ROLE_SIZE,
                                 .unit = "kg m^2",
                                 .meaning = "J of each side, rotor included, at the wheel",
                                 .minimum = 1e-9,
                                 .maximum = 1e4,
                                 .preset = RCX_WHEEL_INERTIA},
    [PARAMETER_RESISTANCE] = {.name = "resistance",
                              .role = BP_ROLE_SIZE,
                              .unit = "ohm",
                              .meaning = "R of eq. 12",
                              .minimum = 1e-4,
                              .maximum = 1e5,
                              .preset = RCX_RESISTANCE},
    [PARAMETER_INDUCTANCE] = {.name = "inductance",
                              .role = BP_ROLE_SIZE,
                              .unit = "H",
                              .meaning = "L of eq. 12",
                              .minimum = 0,
                              .maximum = 10,
                              .preset = RCX_INDUCTANCE,
                              .zero_if_unstated = 1},
    [PARAMETER_EMF_CONSTANT] = {.name = "emf_constant",
                                .role = BP_ROLE_SIZE,
                                .unit = "V s/rad",
                                .meaning = "K_e, at the wheel",
                                .minimum = 0,
                                .maximum = 1e4,
                                .preset = RCX_EMF_CONSTANT},
    [PARAMETER_TORQUE_CONSTANT] = {.name = "torque_constant",
                                   .role = BP_ROLE_SIZE,
                                   .unit = "N m/A",
                                   .meaning = "K_t, at the wheel",
                                   .minimum = 0,
                                   .maximum = 1e4,
                                   .preset = RCX_TORQUE_CONSTANT},
    [PARAMETER_VISCOUS_FRICTION] = {.name = "viscous_friction",
                                    .role = BP_ROLE_SIZE,
                                    .unit = "N m s/rad",
                                    .linear_unit = "N s/m",
                                    .meaning = "b_s of each side",
                                    .minimum = 0,
                                    .maximum = 1e5,
                                    .preset = RCX_VISCOUS_FRICTION},
    [PARAMETER_ROLLING_FRICTION] = {.name = "rolling_friction",
                                    .role = BP_ROLE_SIZE,
                                    .unit = "s/m",
                                    .meaning = "sigma of eq. 13",
                                    .minimum = 0,
                                    .maximum = 10,
                                    .preset = RCX_ROLLING_FRICTION},
    [PARAMETER_DRAG_AREA] = {.name = "drag_area",
                             .role = BP_ROLE_SIZE,
                             .unit = "m^2",
                             .meaning = "C_d A of eq. 5",
                             .minimum = 0,
                             .maximum = 100,
                             .preset = RCX_DRAG_AREA,
                             .zero_if_unstated = 1},
    [PARAMETER_AIR_DENSITY] = {.name = "air_density",
                               .role = BP_ROLE_FIXED,
                               .unit = "kg/m^3",
                               .meaning = "rho of eq. 5",
                               .minimum = 0,
                               .maximum = 10,
                               .preset = RCX_AIR_DENSITY},
    [PARAMETER_GRAVITY] = {.name = "gravity",
                           .role = BP_ROLE_FIXED,
                           .unit = "m/s^2",
                           .meaning = "g of eq. 13",
                           .minimum = 0,
                           .maximum = 30,
                           .preset = RCX_GRAVITY},
    [PARAMETER_BATTERY_VOLTAGE] = {.name = "battery_voltage",
                                   .role = BP_ROLE_SIZE,
                                   .unit = "V",
                                   .meaning = "V_max of eq. 17",
                                   .minimum = 0.1,
                                   .maximum = 1000,
                                   .preset = RCX_BATTERY_VOLTAGE},
    [PARAMETER_STALL_TORQUE] = {.name = "stall_torque",
                                .role = BP_ROLE_FIXED,
                                .unit = "N m",
                                .meaning = "T_stall of eq. 16, paper profile only",
                                .minimum = 1e-6,
                                .maximum = 1e4,
                                .preset = RCX_STALL_TORQUE},
    [PARAMETER_NO_LOAD_SPEED] = {.name = "no_load_speed",
                                 .role = BP_ROLE_FIXED,
                                 .unit = "rad/s",
                                 .meaning = "w_absmax of eq. 16, paper profile only",
                                 .minimum = 1e-3,
                                 .maximum = 1e5,
                                 .preset = RCX_NO_LOAD_SPEED},
    [PARAMETER_FORCE_PER_VOLT] = {.name = "force_per_volt",
                                  .role = BP_ROLE_FIXED,
                                  .unit = "N/V",
                                  .meaning = "force that the input of a motor commands; 0: it commands a voltage",
                                  .minimum = 0,
                                  .maximum = 1e5,
                                  .preset = 0},
    [PARAMETER_TORQUE_PER_VOLT] = {.name = "torque_per_volt",
                                   .role = BP_ROLE_FIXED,
                                   .unit = "N m/V",
                                   .meaning = "torque that the input of a motor commands; 0: it commands a voltage",
                                   .minimum = 0,
                                   .maximum = 1e5,
                                   .preset = 0},
    [PARAMETER_WHEELBASE] = {.name = "wheelbase",
                             .role = BP_ROLE_SIZE,
                             .unit = "m",
                             .meaning = "of a skid_steer: from the front contact of a side to the rear one",
                             .minimum = 1e-3,
                             .maximum = 10,
                             .preset = 0.14},
    [PARAMETER_CONTACT_FRICTION] = {.name = "contact_friction",
                                    .role = BP_ROLE_SIZE,
                                    .unit = "1",
                                    .meaning =
                                        "of a skid_steer: largest force of a contact over its load, in any direction",
                                    .minimum = 1e-3,
                                    .maximum = 10,
                                    .preset = 0.3},
    [PARAMETER_SLIP_SPEED] = {.name = "slip_speed",
                              .role = BP_ROLE_SIZE,
                              .unit = "m/s",
                              .meaning = "of a skid_steer: slip at which a contact bears 71 % of that force",
                              .minimum = 1e-5,
                              .maximum = 10,
                              .preset = 0.01},
};

/* A bare motor has none of these parameters: each is 0 until it is set. */
static const parameter_t OF_A_VEHICLE[] = {PARAMETER_MASS, PARAMETER_WHEEL_RADIUS, PARAMETER_ROLLING_FRICTION,
                                           PARAMETER_DRAG_AREA};

/* True where the vehicle has the parameter. Only a skid steer has the parameters of its contacts. */
static bool has(const bp_model *model, int parameter)
{
    return parameter < PARAMETER_WHEELBASE || model->vehicle == BP_SKID_STEER;
}

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
    if (vehicle < BP_DIFF_DRIVE || vehicle > BP_SKID_STEER || (profile != BP_COUPLED && profile != BP_PAPER) ||
        (vehicle == BP_SKID_STEER && profile == BP_PAPER))
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

/* A BP_MOTOR may have no load (mass, radius) and no inertia of its own. */
static int may_be_absent(const bp_model *model, int parameter)
{
    return model->vehicle == BP_MOTOR &&
           (parameter == PARAMETER_MASS || parameter == PARAMETER_WHEEL_RADIUS || parameter == PARAMETER_WHEEL_INERTIA);
}

int bp_model_set(bp_model *model, const char *parameter, double value)
{
    const int index = parameter_index(parameter);
    if (index < 0 || !has(model, index))
        return BP_E_NAME;
    if (!in_range(&PARAMETER[index], value) && !(value == 0 && may_be_absent(model, index)))
        return BP_E_RANGE;
    model->parameter[index] = value;
    return 0;
}

int bp_model_get(const bp_model *model, const char *parameter, double *value)
{
    const int index = parameter_index(parameter);
    if (index < 0 || !has(model, index))
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

void bp_model_undoable(const bp_model *model, bp_undoable *undoable)
{
    *undoable = (bp_undoable){.flux = {1, 1}, .rim = {1, 1}, .drive_gain = {1, 1}, .gyro_gain = 1, .travel_gain = 1};
    for (int i = 0; i < model->effect_count; i++)
        if (model->effect[i].effect->undo != NULL)
            model->effect[i].effect->undo(model->effect[i].value, undoable);
}
