#include "plant/lanes.h"

#include <stdint.h>
#include <string.h>

#include "plant/contact.h"

static const lanes_kernel_t *const KERNEL[] = {
    &lanes_kernel_2,
#if defined(__x86_64__) && !defined(_WIN32)
    &lanes_kernel_4,
    &lanes_kernel_8,
#endif
};

enum { KERNELS = sizeof KERNEL / sizeof KERNEL[0] };

/* Places of numbers in a vehicle_t. */
#define PLACE(field) ((int)(offsetof(vehicle_t, field) / sizeof(double)))
enum { MOTION_COUNT = 6 }; /* currents, speeds and angles of the wheels: what changes in each motor step */

int lanes_widest(int limit)
{
    int widest = 1;
    for (int i = 0; i < KERNELS; i++)
        if (KERNEL[i]->width <= limit && KERNEL[i]->runs_here())
            widest = KERNEL[i]->width;
    return widest;
}

bool lanes_may_hold(const plant_t *plant)
{
    return contact_of(&plant->vehicle) != &contact_slip;
}

/* Copies numbers of one plant's vehicle from the group. */
static void give(lanes_t *lanes, int lane, int first, int end)
{
    double *one = (double *)&lanes->plant[lane].vehicle;
    const int width = lanes->kernel->width;
    const double *all = lanes->view->vehicle + lane;
    for (int i = first; i < end; i++)
        one[i] = all[i * width];
}

/* Copies them back into the group. */
static void take(lanes_t *lanes, int from, int lane, int first, int end)
{
    const double *one = (const double *)&lanes->plant[from].vehicle;
    const int width = lanes->kernel->width;
    double *all = lanes->view->vehicle + lane;
    for (int i = first; i < end; i++)
        all[i * width] = one[i];
}

/* Gives a plant what the hooks of a site may read and the step has changed since the site before. */
static void give_site(lanes_t *lanes, int lane, site_t site)
{
    plant_t *plant = &lanes->plant[lane];
    switch (site) {
    case SITE_BODY: /* the first of a body step */
        give(lanes, lane, 0, PLACE(command));
        break;
    case SITE_SUPPLY:
        give(lanes, lane, PLACE(supply), PLACE(supply) + 1);
        break;
    case SITE_TIMING:
        give(lanes, lane, PLACE(step), PLACE(supply));
        break;
    case SITE_DRIVE:
        give(lanes, lane, PLACE(state.current), PLACE(state.current) + MOTION_COUNT);
        give(lanes, lane, PLACE(step), PLACE(wheel_torque));
        break;
    case SITE_WHEEL:
        if (plant->hook_count[SITE_DRIVE] == 0)
            give_site(lanes, lane, SITE_DRIVE);
        memset(plant->vehicle.wheel_torque, 0, sizeof plant->vehicle.wheel_torque);
        memset(plant->vehicle.dry, 0, sizeof plant->vehicle.dry);
        break;
    case SITE_SENSOR:
        give(lanes, lane, 0, PLACE(motor));
        break;
    default:
        break;
    }
}

/* Takes over what the hooks of a site may change. */
static void take_site(lanes_t *lanes, int lane, site_t site)
{
    switch (site) {
    case SITE_BODY:
        take(lanes, lane, lane, PLACE(force_surge), PLACE(step));
        break;
    case SITE_SUPPLY:
        take(lanes, lane, lane, PLACE(supply), PLACE(supply) + 1);
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
    default:
        break;
    }
}

/* True where a plant has effects that act before its sensors. */
static bool acts(const plant_t *plant)
{
    for (int site = SITE_TIMING; site < SITE_SENSOR; site++)
        if (plant->hook_count[site] > 0)
            return true;
    return false;
}

static void run_site(void *owner, site_t site)
{
    lanes_t *lanes = owner;
    for (int lane = 0; lane < lanes->count; lane++) {
        plant_t *plant = &lanes->plant[lane];
        const bool here = plant->hook_count[site] > 0 || (site == SITE_BODY && acts(plant));
        if (!here || lanes->status[lane] != 0)
            continue;
        give_site(lanes, lane, site);
        plant_run_site(plant, site);
        take_site(lanes, lane, site);
    }
}

/* Puts plant `from` into a lane as it is. */
static void enter(lanes_t *lanes, int from, int lane)
{
    const int width = lanes->kernel->width;
    take(lanes, from, lane, 0, vehicle_numbers());
    for (int i = 0; i < PARAMETER_COUNT; i++)
        lanes->view->parameter[i * width + lane] = lanes->plant[from].vehicle.parameter[i];
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
    lanes->view->run = run_site;
    lanes->view->owner = lanes;
    lanes->count = count;
    for (int lane = 0; lane < lanes->kernel->width; lane++)
        enter(lanes, lane < count ? lane : 0, lane); /* a lane that is left over does as the first one does */
    for (int lane = 0; lane < count; lane++) {
        lanes->status[lane] = 0;
        for (int site = 0; site < SITE_COUNT; site++)
            lanes->view->acts[site] |= lanes->plant[lane].hook_count[site] > 0;
        lanes->view->acts[SITE_BODY] |= acts(&lanes->plant[lane]);
    }
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
    const plant_t *plant = &lanes->plant[lane];
    const bool own = plant->hook_count[SITE_SENSOR] > 0;
    const double *from = own ? plant->vehicle.output : lanes->view->output + lane;
    const int width = own ? 1 : lanes->kernel->width;
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
