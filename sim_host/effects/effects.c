#include "effects/effect.h"

#include <string.h>

static const effect_t *const TABLE[] = {
    &effect_actuator_deadband,
    &effect_coulomb_friction,
};

enum { TABLE_COUNT = sizeof TABLE / sizeof TABLE[0] };

const effect_t *effect_at(int index)
{
    return index < 0 || index >= TABLE_COUNT ? NULL : TABLE[index];
}

int effect_index(const char *name)
{
    for (int i = 0; i < TABLE_COUNT; i++)
        if (strcmp(TABLE[i]->info.name, name) == 0)
            return i;
    return -1;
}

const bp_effect_info *bp_effect(int index)
{
    const effect_t *effect = effect_at(index);
    return effect == NULL ? NULL : &effect->info;
}
