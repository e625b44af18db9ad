/* composed.h: one vehicle to set terms of the composed effect on, one after another. */
#ifndef BRICKPILOT_TEST_COMPOSED_H
#define BRICKPILOT_TEST_COMPOSED_H

#include <string.h>

#include "drive.h"
#include "effects/composed_laws.h"

static double values[BP_MAX_PARAMETERS];

static inline const bp_effect_info *info(void)
{
    return bp_effect(effect_index("composed_term"));
}

static inline int is_coefficient(const bp_parameter_info *parameter)
{
    return parameter->preset == 0 && strcmp(parameter->name, "clock") != 0;
}

static inline void presets(void)
{
    for (int k = 0; k < info()->parameter_count; k++)
        values[k] = info()->parameters[k].preset;
}

/* Sets one more parameter and keeps those set before. */
static inline void term(const char *name, double value)
{
    int k = 0;
    while (k < info()->parameter_count && strcmp(info()->parameters[k].name, name) != 0)
        k++;
    TEST_ASSERT_TRUE_MESSAGE(k < info()->parameter_count, name);
    values[k] = value;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, bp_model_add_effect(model, "composed_term", values), name);
}

static inline void fresh(int kind, int profile)
{
    presets();
    vehicle(kind, profile);
}

void setUp(void)
{
    fresh(BP_DIFF_DRIVE, BP_COUPLED);
}

void tearDown(void)
{
    bp_model_free(model);
    model = NULL;
}

#endif
