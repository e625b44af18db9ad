/* The kernel of lanes_kernel.h for LANES robots; empty if the build does not define LANES. */
#ifdef LANES

#include <string.h>

#include "plant/contact_load.h"
#include "plant/contact_no_slip.h"
#include "plant/contact_paper.h"
#include "plant/lanes_kernel.h"
#include "plant/output.h"

#define EFFECT(name) extern const effect_t effect_##name;
EFFECTS_IN_LANES
#undef EFFECT

#define EFFECT(name) &effect_##name,
static const effect_t *const LAW[] = {EFFECTS_IN_LANES};
#undef EFFECT

enum { LAW_COUNT = sizeof LAW / sizeof LAW[0] };
enum { MOTOR_NUMBERS = sizeof(motor_t) / sizeof(real_t), MOST_CHANGED = OUTPUT_COUNT };

typedef struct {
    vehicle_t vehicle;
    wheels_t wheels;
    motor_t nominal[2];
    real_t parameter[PARAMETER_COUNT], input[2], output[OUTPUT_COUNT];
    real_t value[LAWS_MOST][LAW_VALUES], memory[LAWS_MOST][LAW_MEMORY];
    const contact_t *contact;
    lanes_view_t view;
} stepped_t;

typedef char fits_its_memory[sizeof(stepped_t) <= LANES_BYTES ? 1 : -1];
typedef char state_is_that_of_one[sizeof(state_t) == LANES * sizeof(bp_state) ? 1 : -1];

/* Range of the numbers of a vehicle_t that the hooks of a site may change: first..end - 1. */
typedef struct {
    size_t first, end;
} stretch_t;

static stretch_t changed_at(site_t site)
{
#define STRETCH(from, to)                                                                                              \
    {                                                                                                                  \
        offsetof(vehicle_t, from) / sizeof(real_t), offsetof(vehicle_t, to) / sizeof(real_t)                           \
    }
    static const stretch_t CHANGED[SITE_COUNT] = {
        [SITE_TIMING] = STRETCH(command, supply),     [SITE_SUPPLY] = STRETCH(supply, voltage),
        [SITE_DRIVE] = STRETCH(supply, wheel_torque), [SITE_MOTOR] = STRETCH(motor, build),
        [SITE_WHEEL] = STRETCH(wheel_torque, motor),  [SITE_BODY] = STRETCH(force_surge, step),
        [SITE_SENSOR] = STRETCH(output, parameter)};
    return CHANGED[site];
}

/* Runs a law for all lanes, then restores the values in lanes whose robot lacks it. Any site's laws may change the
 * heat. */
static void run_law(stepped_t *plant, int index, site_t site)
{
    const lanes_law_t *law = &plant->view.law[index];
    effect_hook_t *hook = law->effect->hook[site];
    if (law->robots == (1U << LANES) - 1) {
        hook(plant->value[index], plant->memory[index], &plant->vehicle);
        return;
    }
    mask_t has = mask_of(0);
    for (int i = 0; i < LANES; i++)
        has[i] = (law->robots >> i & 1U) != 0 ? -1 : 0;
    const stretch_t stretch = changed_at(site);
    real_t *number = (real_t *)&plant->vehicle, before[MOST_CHANGED];
    for (size_t i = stretch.first; i < stretch.end; i++)
        before[i - stretch.first] = number[i];
    real_t *heat = plant->vehicle.state.heat;
    const real_t heat_before[2] = {heat[0], heat[1]};
    hook(plant->value[index], plant->memory[index], &plant->vehicle);
    for (size_t i = stretch.first; i < stretch.end; i++)
        number[i] = choose(has, number[i], before[i - stretch.first]);
    for (int k = 0; k < 2; k++)
        heat[k] = choose(has, heat[k], heat_before[k]);
}

static bool has_hooks(const stepped_t *plant, site_t site)
{
    return plant->view.site[site].count > 0;
}

static void run_hooks(stepped_t *plant, site_t site)
{
    lanes_view_t *view = &plant->view;
    if (site == SITE_BODY && view->tell != NULL)
        view->tell(view->owner, site);
    for (int i = 0; i < view->site[site].count; i++)
        if (view->site[site].step[i].law >= 0)
            run_law(plant, view->site[site].step[i].law, site);
        else
            view->run(view->owner, site, view->site[site].step[i].batch);
}

static void set_motors(stepped_t *plant)
{
    memcpy(plant->vehicle.motor, plant->nominal, sizeof plant->nominal);
    run_hooks(plant, SITE_MOTOR);
    if (plant->view.tell != NULL)
        plant->view.tell(plant->view.owner, SITE_MOTOR);
}

static void sense(stepped_t *plant, double step)
{
    if (!has_hooks(plant, SITE_SENSOR))
        return;
    plant->vehicle.step = real_of(step);
    output_row(&plant->vehicle, plant->vehicle.output);
    run_hooks(plant, SITE_SENSOR);
}

#include "plant/step.h"

static lanes_view_t *open(void *memory, int vehicle, int profile)
{
    stepped_t *plant = memory;
    lanes_view_t *view = &plant->view;
    memset(plant, 0, sizeof *plant);
    plant->vehicle.parameter = plant->parameter;
    plant->vehicle.vehicle = vehicle;
    plant->vehicle.profile = profile;
    const contact_t *of_drive = profile == BP_PAPER ? &contact_paper : &contact_no_slip;
    plant->contact = vehicle == BP_MOTOR ? &contact_load : of_drive;
    view->vehicle = (double *)&plant->vehicle;
    view->nominal = (double *)plant->nominal;
    view->parameter = (double *)plant->parameter;
    view->input = (double *)plant->input;
    view->output = (double *)plant->output;
    for (int i = 0; i < LAWS_MOST; i++) {
        view->law[i].value = (double *)plant->value[i];
        view->law[i].memory = (double *)plant->memory[i];
    }
    return view;
}

static const effect_t *law(const char *name)
{
    for (int i = 0; i < LAW_COUNT; i++)
        if (strcmp(LAW[i]->info.name, name) == 0)
            return LAW[i]->info.parameter_count <= LAW_VALUES && LAW[i]->memory_count <= LAW_MEMORY ? LAW[i] : NULL;
    return NULL;
}

static unsigned advance(void *memory, double step, int body_count, int motor_count)
{
    stepped_t *plant = memory;
    step_sample_begins(plant);
    for (int i = 0; i < body_count; i++)
        step_body(plant, plant->contact, plant->input, step, step / motor_count, motor_count);
    step_sample_ends(plant, body_count);
    const mask_t finite = step_finite(&plant->vehicle.state);
    unsigned bits = 0;
    for (int i = 0; i < LANES; i++)
        bits |= (finite[i] != 0 ? 1U : 0U) << i;
    return bits;
}

static void outputs(void *memory)
{
    stepped_t *plant = memory;
    if (has_hooks(plant, SITE_SENSOR))
        memcpy(plant->output, plant->vehicle.output, sizeof plant->output);
    else
        output_row(&plant->vehicle, plant->output);
    output_felt(&plant->vehicle, plant->output);
}

#if LANES == 8
static bool runs_here(void)
{
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq");
}
const lanes_kernel_t lanes_kernel_8 =
#elif LANES == 4
static bool runs_here(void)
{
    return __builtin_cpu_supports("avx2");
}
const lanes_kernel_t lanes_kernel_4 =
#else
/* All 64-bit processors of x86 and ARM have registers of 128 bits. Elsewhere the compiler splits the vectors. */
static bool runs_here(void)
{
    return true;
}
const lanes_kernel_t lanes_kernel_2 =
#endif
    {.width = LANES,
     .vehicle_numbers = (int)(offsetof(vehicle_t, parameter) / sizeof(real_t)),
     .runs_here = runs_here,
     .open = open,
     .law = law,
     .advance = advance,
     .outputs = outputs};

#endif
