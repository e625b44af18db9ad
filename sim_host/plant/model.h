/* model.h: the fields of bp_model. brickpilot_sim.h documents its functions. */
#ifndef BRICKPILOT_PLANT_MODEL_H
#define BRICKPILOT_PLANT_MODEL_H

#include "effects/effect.h"

enum { MODEL_EFFECTS = 64 }; /* most effects that are on at a time */

struct bp_model {
    int vehicle;
    int profile;
    double parameter[PARAMETER_COUNT];
    int effect_count;
    struct {
        const effect_t *effect;
        double value[BP_MAX_PARAMETERS];
    } effect[MODEL_EFFECTS]; /* in the order of the table, in whatever order they were switched on */
};

#endif
