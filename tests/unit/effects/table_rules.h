/* table_rules.h: what every row of the table of effects must hold. The first fault is returned as one line. */
#ifndef BRICKPILOT_TEST_TABLE_RULES_H
#define BRICKPILOT_TEST_TABLE_RULES_H

#include <ctype.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "effects/effect.h"

static const char *const MECHANISMS[] = {"supply", "drive", "timing", "motor",  "gear", "bearing",
                                         "tyre",   "body",  "floor",  "sensor", NULL};
static const char *const SITES[] = {"supply", "drive", "motor", "gear", "wheel", "body", "sensor", "timing", NULL};
static const char *const SHAPES[] = {"order", "phase", "phase_difference", NULL};

static inline bool is_one_of(const char *text, const char *const *list)
{
    for (; text != NULL && *list != NULL; list++)
        if (strcmp(text, *list) == 0)
            return true;
    return false;
}

static inline bool is_empty(const char *text)
{
    return text == NULL || text[0] == 0;
}

static inline bool is_parameter(const bp_effect_info *effect, const char *name)
{
    for (int k = 0; k < effect->parameter_count; k++)
        if (effect->parameters[k].name != NULL && strcmp(effect->parameters[k].name, name) == 0)
            return true;
    return false;
}

static inline bool is_signal(const char *name)
{
    for (int i = 0; bp_output_name(i) != NULL; i++)
        if (strcmp(bp_output_name(i), name) == 0)
            return true;
    return strcmp(name, "voltage") == 0;
}

static inline bool is_nominal(const char *name)
{
    for (int i = 0; bp_parameter(i) != NULL; i++)
        if (strcmp(bp_parameter(i)->name, name) == 0)
            return true;
    return false;
}

/* No clause, or one with a place for a size and without a full stop. */
static inline bool is_clause(const char *text)
{
    return text == NULL || (strstr(text, "{}") != NULL && islower((unsigned char)text[0]) && strchr(text, '.') == NULL);
}

/* What a parameter lacks, or NULL. */
static inline const char *parameter_fault(const bp_effect_info *effect, const bp_parameter_info *one)
{
    if (is_empty(one->unit))
        return "has no unit; write \"1\" where there is none";
    if (is_empty(one->meaning))
        return "has no meaning";
    if (one->role < BP_ROLE_SIZE || one->role > BP_ROLE_LIMIT)
        return "has no role: BP_ROLE_SIZE, _SHAPE, _PLACE, _SWITCH or _LIMIT";
    if (!(one->minimum < one->maximum && one->minimum <= one->preset && one->preset <= one->maximum))
        return "has a preset outside minimum..maximum";
    if ((one->role == BP_ROLE_SWITCH) != (one->minimum == 0 && one->maximum == 1 && one->preset == 0 && !one->optional))
        return "is a switch or looks like one: role BP_ROLE_SWITCH goes with the range 0..1 and the preset 0";
    if ((one->role == BP_ROLE_LIMIT) != (one->limits != NULL) || (one->limits != NULL && !is_signal(one->limits)))
        return "needs `limits`, an output or \"voltage\", just where its role is BP_ROLE_LIMIT";
    if (is_one_of(one->name, SHAPES) && one->role != BP_ROLE_SHAPE)
        return "has a name that stands for a shape, and another role";
    if (one->odd && one->minimum != -one->maximum)
        return "is odd, and its range is not the same on both sides of 0";
    if ((one->optional || one->trial != 0) && one->preset != 0)
        return "is optional or has a `trial`, which asks for a preset of 0";
    if (one->scan_count != 0 &&
        !(one->scan_count > 1 && one->scan_from > 0 && one->scan_from < one->scan_to && one->scan_to <= one->maximum))
        return "has a scan that is no list of two sizes or more within its range";
    if ((one->arm_of != NULL && !is_parameter(effect, one->arm_of)) ||
        (one->only_with != NULL && !is_parameter(effect, one->only_with)))
        return "has an `arm_of` or `only_with` that names no parameter of this effect";
    if (one->mechanism != NULL && !is_one_of(one->mechanism, MECHANISMS))
        return "has a `mechanism` that is not of the list in brickpilot_sim.h";
    if (one->same_as != NULL && !is_nominal(one->same_as))
        return "has a `same_as` that names no nominal parameter";
    if (!is_clause(one->says) || !is_clause(one->says_below) || (one->odd && one->says_below != NULL))
        return "has a `says` or `says_below` that is no clause with {}, or the second although left and right change "
               "places";
    if (one->says != NULL && one->minimum < 0 && !one->odd && one->says_below == NULL)
        return "has a `says`, and no `says_below` for values below 0";
    return NULL;
}

static inline bool is_sentence(const char *text)
{
    return !is_empty(text) && isupper((unsigned char)text[0]) && text[strlen(text) - 1] == '.';
}

static inline const char *sentence_fault(const bp_effect_info *info)
{
    if (is_empty(info->words) || isupper((unsigned char)info->words[0]) || strchr(info->words, '.') != NULL)
        return "has no `words`: a noun phrase, as in \"The simulator lacks ...\", without a full stop";
    if (!is_sentence(info->summary))
        return "has no `summary`: one sentence, from a capital letter to a full stop";
    if (!info->composed && !is_sentence(info->advice))
        return "has no `advice`: one sentence on what to do, from a capital letter to a full stop";
    return NULL;
}

static inline const char *prior_fault(const bp_effect_info *info)
{
    if (info->prior < BP_PRIOR_COMMON || info->prior > BP_PRIOR_RARE)
        return "has no prior: BP_PRIOR_COMMON, _USUAL or _RARE";
    if (!is_sentence(info->prior_reason))
        return "has no `prior_reason`: one sentence, from a capital letter to a full stop";
    const char *const reason[] = {info->prior_reason, NULL};
    for (int i = 0; bp_effect(i) != NULL; i++)
        if (bp_effect(i) != info && is_one_of(bp_effect(i)->prior_reason, reason))
            return "has the `prior_reason` of another effect";
    return NULL;
}

/* `contains` holds names of other effects, one after another with a space between. */
static inline const char *contains_fault(const bp_effect_info *info)
{
    for (const char *name = info->contains; !is_empty(name);) {
        const size_t length = strcspn(name, " ");
        char one[64] = "";
        if (length < sizeof one)
            memcpy(one, name, length);
        if (effect_index(one) < 0 || strcmp(one, info->name) == 0)
            return "has a `contains` that names no other effect";
        name += length + (name[length] == ' ');
    }
    return NULL;
}

/* A variant has the mechanism of what it varies, so that a family is never split between two mechanisms. */
static inline const char *variant_fault(const bp_effect_info *info)
{
    if (is_empty(info->variant_of) != is_empty(info->variation))
        return "needs `variant_of` and `variation` together";
    if (is_empty(info->variant_of))
        return NULL;
    const bp_effect_info *plain = bp_effect(effect_index(info->variant_of));
    if (plain == NULL || plain->variant_of != NULL || strcmp(plain->mechanism, info->mechanism) != 0)
        return "has a `variant_of` that is no effect of its mechanism, or a variant itself";
    return NULL;
}

static inline const char *row_fault(const effect_t *effect)
{
    const bp_effect_info *info = &effect->info;
    bool acts = false;

    for (int site = 0; site < SITE_COUNT; site++)
        acts = acts || effect->hook[site] != NULL;
    if (!acts)
        return "has no hook";
    if (!is_one_of(info->mechanism, MECHANISMS))
        return "has no `mechanism` of the list in brickpilot_sim.h";
    if (!is_one_of(info->acts_on, SITES))
        return "has no `acts_on` of the list in brickpilot_sim.h";
    if (is_empty(info->equation) || is_empty(info->source))
        return "has no `equation` or no `source`";
    if (strstr(info->equation, "real_") != NULL)
        return "has an `equation` with a function of effects/real.h; write it as mathematics";
    if (info->parameter_count < 1 || info->parameter_count > BP_MAX_PARAMETERS)
        return "has no parameters, or more than BP_MAX_PARAMETERS";
    static const char *(*const FAULT[])(const bp_effect_info *) = {sentence_fault, prior_fault, contains_fault,
                                                                   variant_fault};
    const char *fault = NULL;
    for (size_t i = 0; i < sizeof FAULT / sizeof FAULT[0] && fault == NULL; i++)
        fault = FAULT[i](info);
    return fault;
}

/* Fills `line` with the first fault of the effect. Returns false where there is none. */
static inline bool effect_fault(const effect_t *effect, char *line, size_t room)
{
    const char *fault = is_empty(effect->info.name) ? "has no name" : row_fault(effect);

    if (fault != NULL) {
        snprintf(line, room, "effect %s %s", is_empty(effect->info.name) ? "?" : effect->info.name, fault);
        return true;
    }
    for (int k = 0; k < effect->info.parameter_count; k++) {
        const bp_parameter_info *one = &effect->info.parameters[k];
        fault = is_empty(one->name) ? "has no name" : parameter_fault(&effect->info, one);
        if (fault != NULL) {
            snprintf(line, room, "effect %s, parameter %s %s", effect->info.name, is_empty(one->name) ? "?" : one->name,
                     fault);
            return true;
        }
    }
    return false;
}

#endif
