/* lanes_laws.h: the kernel of lanes_kernel.h for LANES robots, as LANES_KERNEL. */
#ifndef BRICKPILOT_PLANT_LANES_LAWS_H
#define BRICKPILOT_PLANT_LANES_LAWS_H

#include "plant/contact_load.h"
#include "plant/contact_no_slip.h"
#include "plant/contact_paper.h"
#include "plant/lanes_kernel.h"
#include "plant/output.h"

typedef struct {
    vehicle_t vehicle;
    wheels_t wheels;
    real_t parameter[PARAMETER_COUNT], input[2], output[OUTPUT_COUNT];
    const contact_t *contact;
    lanes_view_t view;
} stepped_t;

typedef char fits_its_memory[sizeof(stepped_t) <= LANES_BYTES ? 1 : -1];
typedef char state_is_that_of_one[sizeof(state_t) == LANES * sizeof(bp_state) ? 1 : -1];

static bool has_hooks(const stepped_t *plant, site_t site)
{
    return plant->view.acts[site];
}

static void run_hooks(stepped_t *plant, site_t site)
{
    if (plant->view.acts[site])
        plant->view.run(plant->view.owner, site);
}

static void set_motors(stepped_t *plant)
{
    run_hooks(plant, SITE_MOTOR);
}

static void sense(stepped_t *plant, double step)
{
    plant->vehicle.step = real_of(step);
    run_hooks(plant, SITE_SENSOR);
}

#include "plant/step.h"

static lanes_view_t *open(void *memory, int vehicle, int profile)
{
    stepped_t *plant = memory;
    memset(plant, 0, sizeof *plant);
    plant->vehicle.parameter = plant->parameter;
    plant->vehicle.vehicle = vehicle;
    plant->vehicle.profile = profile;
    const contact_t *of_drive = profile == BP_PAPER ? &contact_paper : &contact_no_slip;
    plant->contact = vehicle == BP_MOTOR ? &contact_load : of_drive;
    plant->view.vehicle = (double *)&plant->vehicle;
    plant->view.parameter = (double *)plant->parameter;
    plant->view.input = (double *)plant->input;
    plant->view.output = (double *)plant->output;
    return &plant->view;
}

static unsigned advance(void *memory, double step, int body_count, int motor_count)
{
    stepped_t *plant = memory;
    for (int i = 0; i < body_count; i++)
        step_body(plant, plant->contact, plant->input, step, step / motor_count, motor_count);
    const mask_t finite = step_finite(&plant->vehicle.state);
    unsigned bits = 0;
    for (int i = 0; i < LANES; i++)
        bits |= (finite[i] != 0 ? 1U : 0U) << i;
    return bits;
}

static void outputs(void *memory)
{
    stepped_t *plant = memory;
    output_row(&plant->vehicle, plant->output);
}

static bool runs_here(void)
{
    return LANES_RUN_HERE;
}

const lanes_kernel_t LANES_KERNEL = {.width = LANES,
                                     .vehicle_numbers = (int)(offsetof(vehicle_t, parameter) / sizeof(real_t)),
                                     .runs_here = runs_here,
                                     .open = open,
                                     .advance = advance,
                                     .outputs = outputs};

#endif
