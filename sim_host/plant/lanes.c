#include "plant/lanes.h"

#include <stdint.h>
#include <string.h>

#include "plant/contact.h"

/* LANES_BUILT: width of the widest kernel in this build. Without kernels each run is simulated alone. */
#ifndef LANES_BUILT
#define LANES_BUILT 1
#endif

static const lanes_kernel_t *const KERNEL[] = {
#if LANES_BUILT >= 2
    &lanes_kernel_2,
#endif
#if LANES_BUILT >= 8
    &lanes_kernel_4, &lanes_kernel_8,
#endif
    NULL};

/* Index of a field in a vehicle_t, counted in numbers. */
#define PLACE(field) ((int)(offsetof(vehicle_t, field) / sizeof(double)))
enum { MOTION_COUNT = 6 }; /* numbers that each motor step changes: currents, speeds and angles of the wheels */

int lanes_widest(int limit)
{
    int widest = 1;
    for (int i = 0; KERNEL[i] != NULL; i++)
        if (KERNEL[i]->width <= limit && KERNEL[i]->runs_here())
            widest = KERNEL[i]->width;
    return widest;
}

int lanes_shared(int count, int threads, int limit)
{
    const int each = threads > 1 && count > 0 ? (count - 1) / threads + 1 : count;
    return lanes_widest(each < limit ? each : limit);
}

bool lanes_may_hold(const plant_t *plant)
{
    return contact_of(&plant->vehicle) != &contact_slip;
}

/* Copies numbers first..end - 1 of one vehicle from the group to its plant. */
static void give(lanes_t *lanes, int lane, int first, int end)
{
    double *one = (double *)&lanes->plant[lane].vehicle;
    const int width = lanes->kernel->width;
    const double *all = lanes->view->vehicle + lane;
    for (int i = first; i < end; i++)
        one[i] = all[i * width];
}

/* Copies numbers first..end - 1 of plant `from` into a lane of the group. */
static void take(lanes_t *lanes, int from, int lane, int first, int end)
{
    const double *one = (const double *)&lanes->plant[from].vehicle;
    const int width = lanes->kernel->width;
    double *all = lanes->view->vehicle + lane;
    for (int i = first; i < end; i++)
        all[i * width] = one[i];
}

/* Gives a plant the numbers that the hooks of a site may read and that have changed since the last site. */
static void give_site(lanes_t *lanes, int lane, site_t site)
{
    switch (site) {
    case SITE_BODY:
        give(lanes, lane, PLACE(force_surge), PLACE(step));
        break;
    case SITE_SUPPLY:
        give(lanes, lane, PLACE(supply), PLACE(voltage));
        break;
    case SITE_MOTOR:
        give(lanes, lane, PLACE(motor), PLACE(build));
        break;
    case SITE_TIMING:
        give(lanes, lane, PLACE(step), PLACE(supply));
        break;
    case SITE_DRIVE:
        give(lanes, lane, PLACE(state.current), PLACE(state.current) + MOTION_COUNT);
        give(lanes, lane, PLACE(step), PLACE(wheel_torque));
        break;
    case SITE_WHEEL:
        give(lanes, lane, PLACE(state.current), PLACE(state.current) + MOTION_COUNT);
        give(lanes, lane, PLACE(state.heat), PLACE(state.heat) + 2);
        give(lanes, lane, PLACE(step), PLACE(motor));
        break;
    case SITE_SENSOR:
        give(lanes, lane, 0, PLACE(motor));
        give(lanes, lane, PLACE(output), vehicle_numbers());
        break;
    default:
        break;
    }
}

/* Copies the numbers that the hooks of a site may change from the plant to its lane. */
static void take_site(lanes_t *lanes, int lane, site_t site)
{
    switch (site) {
    case SITE_BODY:
        take(lanes, lane, lane, PLACE(force_surge), PLACE(step));
        break;
    case SITE_SUPPLY:
        take(lanes, lane, lane, PLACE(supply), PLACE(voltage));
        break;
    case SITE_MOTOR:
        take(lanes, lane, lane, PLACE(motor), PLACE(build));
        break;
    case SITE_TIMING:
        take(lanes, lane, lane, PLACE(command), PLACE(supply));
        break;
    case SITE_DRIVE:
        take(lanes, lane, lane, PLACE(supply), PLACE(wheel_torque));
        break;
    case SITE_WHEEL:
        take(lanes, lane, lane, PLACE(state.heat), PLACE(state.heat) + 2);
        take(lanes, lane, lane, PLACE(wheel_torque), PLACE(motor));
        break;
    case SITE_SENSOR:
        take(lanes, lane, lane, PLACE(output), vehicle_numbers());
        break;
    default:
        break;
    }
}

/* Gives the state and derived values (at SITE_MOTOR, the motors) to each plant with hooks that run robot by robot. */
static void tell(void *owner, site_t site)
{
    lanes_t *lanes = owner;
    const int first = site == SITE_MOTOR ? PLACE(motor) : 0, end = site == SITE_MOTOR ? PLACE(build) : PLACE(command);
    for (int lane = 0; lane < lanes->count; lane++)
        if (lanes->acts[lane] && lanes->status[lane] == 0)
            give(lanes, lane, first, end);
}

static void run_batch(void *owner, site_t site, int batch)
{
    lanes_t *lanes = owner;
    for (int lane = 0; lane < lanes->count; lane++) {
        plant_t *plant = &lanes->plant[lane];
        const hooks_t hooks = lanes->batch[site][batch][lane];
        if (hooks.first == hooks.end || lanes->status[lane] != 0)
            continue;
        give_site(lanes, lane, site);
        for (int i = hooks.first; i < hooks.end; i++) {
            const plant_hook_t *hook = &plant->hook[site][i];
            hook->hook(hook->value, hook->memory, &plant->vehicle);
        }
        take_site(lanes, lane, site);
    }
}

/* The index of the law in registers for an effect; -1: the effect runs robot by robot. */
static int law_of(lanes_t *lanes, const effect_t *effect)
{
    for (int i = 0; i < lanes->law_count; i++)
        if (lanes->effect_of_law[i] == effect)
            return i;
    const effect_t *law = lanes->law_count < LAWS_MOST ? lanes->kernel->law(effect->info.name) : NULL;
    if (law == NULL)
        return -1;
    lanes->view->law[lanes->law_count].effect = law;
    lanes->effect_of_law[lanes->law_count] = effect;
    return lanes->law_count++;
}

/* Copies the effects of plant `from` that have a law in registers into a lane. */
static void enter_effects(lanes_t *lanes, int from, int lane)
{
    const bp_model *model = lanes->plant[from].model;
    const double *memory = lanes->plant[from].memory;
    const int width = lanes->kernel->width;
    for (int e = 0; e < model->effect_count; e++) {
        const effect_t *effect = model->effect[e].effect;
        const int index = law_of(lanes, effect);
        if (index >= 0) {
            lanes_law_t *law = &lanes->view->law[index];
            law->robots |= 1U << lane;
            for (int i = 0; i < effect->info.parameter_count; i++)
                law->value[i * width + lane] = model->effect[e].value[i];
            for (int i = 0; i < effect->memory_count; i++)
                law->memory[i * width + lane] = memory[i];
        }
        memory += effect->memory_count;
    }
}

/* Copies plant `from`, in its present state, into a lane. */
static void enter(lanes_t *lanes, int from, int lane)
{
    const int width = lanes->kernel->width;
    const vehicle_t *vehicle = &lanes->plant[from].vehicle;
    take(lanes, from, lane, 0, vehicle_numbers());
    for (int i = 0; i < PARAMETER_COUNT; i++)
        lanes->view->parameter[i * width + lane] = vehicle->parameter[i];
    motor_t nominal[2];
    plant_nominal_motors(vehicle, nominal);
    for (int i = 0; i < (int)(PLACE(build) - PLACE(motor)); i++)
        lanes->view->nominal[i * width + lane] = ((const double *)nominal)[i];
    enter_effects(lanes, from, lane);
}

/* Position of each plant in its model's list of effects, while order_site() computes the order. */
typedef struct {
    int effect[LANES_MOST];
    int hook[LANES_MOST]; /* number of earlier effects with a hook at the site */
} cursor_t;

/* The next effect at a site, over all plants; NULL after the last. */
static const effect_t *next_effect(const lanes_t *lanes, cursor_t *at, site_t site)
{
    const effect_t *first = NULL;
    for (int lane = 0; lane < lanes->count; lane++) {
        const bp_model *model = lanes->plant[lane].model;
        int *e = &at->effect[lane];
        while (*e < model->effect_count && model->effect[*e].effect->hook[site] == NULL)
            ++*e;
        if (*e == model->effect_count || first == model->effect[*e].effect)
            continue;
        const effect_t *effect = model->effect[*e].effect;
        if (first == NULL || effect_index(effect->info.name) < effect_index(first->info.name))
            first = effect;
    }
    return first;
}

/* Stores the order in which laws and batches of hooks run at a site. */
static void order_site(lanes_t *lanes, site_t site)
{
    lanes_site_t *order = &lanes->view->site[site];
    cursor_t at = {.effect = {0}};
    int batches = 0;
    bool open = false; /* the last step is a batch */
    for (const effect_t *effect = next_effect(lanes, &at, site); effect != NULL;
         effect = next_effect(lanes, &at, site)) {
        const int law = law_of(lanes, effect);
        if (law < 0 && !open)
            for (int lane = 0; lane < lanes->count; lane++)
                lanes->batch[site][batches][lane] =
                    (hooks_t){(unsigned char)at.hook[lane], (unsigned char)at.hook[lane]};
        if (law >= 0 || !open) {
            order->step[order->count].law = law;
            order->step[order->count++].batch = law < 0 ? batches++ : 0;
        }
        open = law < 0;
        for (int lane = 0; lane < lanes->count; lane++) {
            const bp_model *model = lanes->plant[lane].model;
            if (at.effect[lane] == model->effect_count || model->effect[at.effect[lane]].effect != effect)
                continue;
            at.effect[lane]++;
            at.hook[lane]++;
            if (law < 0) {
                lanes->batch[site][batches - 1][lane].end++;
                lanes->acts[lane] |= site != SITE_SENSOR;
            }
        }
    }
}

void lanes_open(lanes_t *lanes, int count)
{
    int narrowest = 0;
    while (KERNEL[narrowest]->width < count)
        narrowest++;
    const vehicle_t *first = &lanes->plant[0].vehicle;
    lanes->kernel = KERNEL[narrowest];
    lanes->memory = lanes->space + LANES_ALIGNMENT - (uintptr_t)lanes->space % LANES_ALIGNMENT;
    lanes->view = lanes->kernel->open(lanes->memory, first->vehicle, first->profile);
    lanes->count = count;
    lanes->law_count = 0;
    memset(lanes->status, 0, sizeof lanes->status);
    memset(lanes->acts, 0, sizeof lanes->acts);
    for (int lane = 0; lane < lanes->kernel->width; lane++)
        enter(lanes, lane < count ? lane : 0, lane); /* an unused lane repeats the first plant */
    for (int site = SITE_TIMING; site < SITE_COUNT; site++)
        order_site(lanes, (site_t)site);
    lanes->view->tell = NULL;
    for (int lane = 0; lane < count; lane++)
        if (lanes->acts[lane])
            lanes->view->tell = tell;
    lanes->view->run = run_batch;
    lanes->view->owner = lanes;
}

void lanes_restart(lanes_t *lanes, int lane, const bp_state *state)
{
    if (lanes->status[lane] != 0)
        return;
    give(lanes, lane, 0, PLACE(motor));
    lanes->status[lane] = plant_restart(&lanes->plant[lane], state);
    take(lanes, lane, lane, 0, PLACE(motor));
}

void lanes_advance(lanes_t *lanes, const double input[][2], double dt)
{
    int body_count, motor_count;
    const int status = plant_divide(&lanes->plant[0], dt, &body_count, &motor_count);
    const int width = lanes->kernel->width;
    for (int lane = 0; lane < width; lane++)
        for (int k = 0; k < 2; k++)
            lanes->view->input[k * width + lane] = input[lane < lanes->count ? lane : 0][k];
    const unsigned finite =
        status == 0 ? lanes->kernel->advance(lanes->memory, dt / body_count, body_count, motor_count) : 0;
    for (int lane = 0; lane < lanes->count; lane++)
        if (lanes->status[lane] == 0 && (finite >> lane & 1U) == 0)
            lanes->status[lane] = status != 0 ? status : BP_E_DIVERGED;
}

void lanes_sense(lanes_t *lanes)
{
    lanes->kernel->outputs(lanes->memory);
}

void lanes_outputs(const lanes_t *lanes, int lane, const int *column, int count, double *out, ptrdiff_t stride)
{
    const double *from = lanes->view->output + lane;
    const int width = lanes->kernel->width;
    for (int i = 0; i < count; i++)
        out[i * stride] = from[(column != NULL ? column[i] : i) * width];
}

bp_state lanes_state(const lanes_t *lanes, int lane)
{
    bp_state state;
    double number[sizeof state / sizeof(double)];
    for (size_t i = 0; i < sizeof number / sizeof number[0]; i++)
        number[i] = lanes->view->vehicle[(int)i * lanes->kernel->width + lane];
    memcpy(&state, number, sizeof state);
    return state;
}

void lanes_tell(lanes_t *lanes, int lane)
{
    give_site(lanes, lane, SITE_SENSOR);
}
