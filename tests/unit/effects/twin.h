/* twin.h: one vehicle with an effect and one without, driven alike: what is seen, and what is. */
#ifndef BRICKPILOT_TEST_TWIN_H
#define BRICKPILOT_TEST_TWIN_H

#include "plant/plant.h"
#include "unity.h"

static const double STEP = 0.003;

static bp_model *plain, *changed;
static plant_t plain_plant, changed_plant;
static double truth[OUTPUT_COUNT], seen[OUTPUT_COUNT];

static inline void twin_new(int vehicle)
{
    plain = bp_model_new(vehicle, BP_COUPLED);
    changed = bp_model_new(vehicle, BP_COUPLED);
}

static inline void twin_free(void)
{
    bp_model_free(plain);
    bp_model_free(changed);
}

static inline void look(void)
{
    plant_outputs(&plain_plant, truth);
    plant_outputs(&changed_plant, seen);
}

/* Starts both, the changed one with the effect. initial: NULL is at rest. */
static inline void begin(const char *effect, const double *values, const bp_state *initial)
{
    TEST_ASSERT_EQUAL_INT(0, bp_model_add_effect(changed, effect, values));
    TEST_ASSERT_EQUAL_INT(0, plant_start(&plain_plant, plain, initial, 0, 0));
    TEST_ASSERT_EQUAL_INT(0, plant_start(&changed_plant, changed, initial, 0, 0));
    look();
}

/* One sample of dt seconds. */
static inline void advance(double left, double right, double dt)
{
    const double input[2] = {left, right};
    TEST_ASSERT_EQUAL_INT(0, plant_advance(&plain_plant, input, dt));
    TEST_ASSERT_EQUAL_INT(0, plant_advance(&changed_plant, input, dt));
    look();
}

static inline void go(double left, double right, double seconds)
{
    for (int i = 0; i < (int)(seconds / STEP + 0.5); i++)
        advance(left, right, STEP);
}

/* The signals but those from `first` to `last` are untouched, and so is the vehicle. */
static inline void assert_only(int first, int last)
{
    for (int i = 0; i < OUTPUT_COUNT; i++)
        if (i < first || i > last)
            TEST_ASSERT_EQUAL_MEMORY_MESSAGE(&truth[i], &seen[i], sizeof truth[i], bp_output_name(i));
    TEST_ASSERT_EQUAL_MEMORY(&plain_plant.vehicle.state, &changed_plant.vehicle.state, sizeof(bp_state));
}

#endif
