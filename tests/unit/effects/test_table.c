/* Every row of the table is complete, and each thing that a row can lack is found and named. */
#include "table_rules.h"
#include "unity.h"

static char line[256];

void setUp(void) {}
void tearDown(void) {}

static void test_every_row_is_complete(void)
{
    for (int i = 0; effect_at(i) != NULL; i++)
        if (effect_fault(effect_at(i), line, sizeof line))
            TEST_FAIL_MESSAGE(line);
    TEST_ASSERT_NOT_NULL(bp_effect(0));
}

static void test_every_name_stands_for_one_row(void)
{
    for (int i = 0; effect_at(i) != NULL; i++)
        TEST_ASSERT_EQUAL_INT_MESSAGE(i, effect_index(bp_effect(i)->name), bp_effect(i)->name);
}

/* With all its parameters at 0 an effect changes nothing, so there is nothing to undo. */
static void test_an_effect_of_no_size_leaves_nothing_to_undo(void)
{
    bp_model *model = bp_model_new(BP_DIFF_DRIVE, BP_COUPLED);
    const double zero[BP_MAX_PARAMETERS] = {0};
    bp_undoable plain, found;
    int undone = 0;

    bp_model_undoable(model, &plain);
    bp_model_free(model);
    for (int i = 0; effect_at(i) != NULL; i++) {
        if (effect_at(i)->undo == NULL)
            continue;
        found = plain;
        effect_at(i)->undo(zero, &found);
        TEST_ASSERT_EQUAL_MEMORY_MESSAGE(&plain, &found, sizeof plain, bp_effect(i)->name);
        undone++;
    }
    TEST_ASSERT_GREATER_THAN_INT(0, undone);
}

static void test_what_can_be_undone_adds_up_over_the_effects_of_a_model(void)
{
    bp_model *model = bp_model_new(BP_DIFF_DRIVE, BP_COUPLED);
    const double torque = 0.004, stribeck[3] = {0.003, 0.002, 1}, offset[2] = {0.005, 0.001}, difference = 0.1;
    bp_undoable found;

    TEST_ASSERT_EQUAL_INT(0, bp_model_add_effect(model, "coulomb_friction", &torque));
    TEST_ASSERT_EQUAL_INT(0, bp_model_add_effect(model, "stiction_stribeck", stribeck));
    TEST_ASSERT_EQUAL_INT(0, bp_model_add_effect(model, "constant_offset", offset));
    TEST_ASSERT_EQUAL_INT(0, bp_model_add_effect(model, "motor_asymmetry", &difference));
    bp_model_undoable(model, &found);
    bp_model_free(model);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 0.007, found.dry_torque[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 0.007, found.dry_torque[1]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 0.006, found.load[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 0.004, found.load[1]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 1.05, found.drive_gain[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-15, 0.95, found.drive_gain[1]);
}

static void nothing(const double *value, double *memory, vehicle_t *vehicle)
{
    (void)value;
    (void)memory;
    (void)vehicle;
}

static const bp_parameter_info SOUND_PARAMETER = {.name = "torque",
                                                  .role = BP_ROLE_SIZE,
                                                  .unit = "N m",
                                                  .meaning = "a torque",
                                                  .minimum = -1,
                                                  .maximum = 1,
                                                  .preset = 0.5};

/* A sound row, which each test below spoils in one place. */
static effect_t sound(const bp_parameter_info *parameter)
{
    return (effect_t){.info = {.name = "made_up",
                               .words = "a made-up effect",
                               .summary = "It does nothing.",
                               .mechanism = "motor",
                               .acts_on = "wheel",
                               .equation = "T = 0",
                               .source = "none",
                               .prior = BP_PRIOR_RARE,
                               .prior_reason = "Nobody has made it but this test.",
                               .advice = "Take it away.",
                               .parameter_count = 1,
                               .parameters = parameter},
                      .hook = {[SITE_WHEEL] = nothing}};
}

static void assert_fault(effect_t effect, const char *part)
{
    TEST_ASSERT_TRUE_MESSAGE(effect_fault(&effect, line, sizeof line), part);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(line, part), line);
    TEST_ASSERT_NULL_MESSAGE(strchr(line, '\n'), line);
}

static void test_a_sound_row_has_no_fault(void)
{
    effect_t effect = sound(&SOUND_PARAMETER);
    TEST_ASSERT_FALSE(effect_fault(&effect, line, sizeof line));
}

static void test_a_row_that_lacks_something_is_named(void)
{
    effect_t effect = sound(&SOUND_PARAMETER);
    effect.info.words = NULL;
    assert_fault(effect, "effect made_up has no `words`");

    effect = sound(&SOUND_PARAMETER);
    effect.info.summary = "no sentence";
    assert_fault(effect, "effect made_up has no `summary`");

    effect = sound(&SOUND_PARAMETER);
    effect.info.mechanism = "magic";
    assert_fault(effect, "effect made_up has no `mechanism`");

    effect = sound(&SOUND_PARAMETER);
    effect.info.acts_on = NULL;
    assert_fault(effect, "effect made_up has no `acts_on`");

    effect = sound(&SOUND_PARAMETER);
    effect.info.source = "";
    assert_fault(effect, "effect made_up has no `equation` or no `source`");

    effect = sound(&SOUND_PARAMETER);
    effect.info.equation = "T = real_sin(x)";
    assert_fault(effect, "effect made_up has an `equation` with a function");

    effect = sound(&SOUND_PARAMETER);
    effect.hook[SITE_WHEEL] = NULL;
    assert_fault(effect, "effect made_up has no hook");
}

static void test_a_prior_that_is_missing_or_copied_is_named(void)
{
    effect_t effect = sound(&SOUND_PARAMETER);
    effect.info.prior = 0;
    assert_fault(effect, "effect made_up has no prior");

    effect = sound(&SOUND_PARAMETER);
    effect.info.prior_reason = "because it is so";
    assert_fault(effect, "effect made_up has no `prior_reason`");

    effect.info.prior_reason = NULL;
    assert_fault(effect, "effect made_up has no `prior_reason`");

    effect.info.prior_reason = bp_effect(3)->prior_reason;
    assert_fault(effect, "effect made_up has the `prior_reason` of another effect");
}

static void test_a_row_says_what_to_do_and_what_its_values_mean(void)
{
    effect_t effect = sound(&SOUND_PARAMETER);
    effect.info.advice = NULL;
    assert_fault(effect, "effect made_up has no `advice`");

    bp_parameter_info parameter = SOUND_PARAMETER;
    parameter.says = "the torque is large";
    assert_fault(sound(&parameter), "effect made_up, parameter torque has a `says`");
    parameter.says = "the torque is {} too large";
    assert_fault(sound(&parameter), "effect made_up, parameter torque has a `says`, and no `says_below`");
    parameter.odd = 1;
    parameter.says_below = parameter.says;
    assert_fault(sound(&parameter), "effect made_up, parameter torque has a `says`");
}

static void test_what_a_law_contains_are_other_effects(void)
{
    effect_t effect = sound(&SOUND_PARAMETER);
    effect.info.contains = "coulomb_friction wheel_slip";
    TEST_ASSERT_FALSE(effect_fault(&effect, line, sizeof line));

    effect.info.contains = "coulomb_friction no_effect";
    assert_fault(effect, "effect made_up has a `contains` that names no other effect");

    effect.info.contains = "coulomb_friction, wheel_slip";
    assert_fault(effect, "effect made_up has a `contains`");

    effect.info.contains = "wheel_slip made_up";
    assert_fault(effect, "effect made_up has a `contains`");

    effect.info.name = "wheel_slip";
    effect.info.contains = "wheel_slip";
    assert_fault(effect, "effect wheel_slip has a `contains`");
}

static void test_a_variant_that_is_none_is_named(void)
{
    effect_t effect = sound(&SOUND_PARAMETER);
    effect.info.variant_of = "torque_ripple";
    assert_fault(effect, "effect made_up needs `variant_of` and `variation` together");

    effect.info.variation = "made up";
    TEST_ASSERT_FALSE(effect_fault(&effect, line, sizeof line));

    effect.info.variant_of = "coulomb_friction";
    assert_fault(effect, "effect made_up has a `variant_of` that is no effect of its mechanism");

    effect.info.mechanism = "bearing";
    effect.info.variant_of = "stiction_stribeck";
    assert_fault(effect, "or a variant itself");

    effect.info.variant_of = "no_effect";
    assert_fault(effect, "effect made_up has a `variant_of` that is no effect");
}

static void assert_parameter_fault(bp_parameter_info parameter, const char *part)
{
    assert_fault(sound(&parameter), part);
}

static void test_a_parameter_that_lacks_something_is_named(void)
{
    bp_parameter_info spoilt = SOUND_PARAMETER;
    spoilt.role = 0;
    assert_parameter_fault(spoilt, "effect made_up, parameter torque has no role");

    spoilt = SOUND_PARAMETER;
    spoilt.unit = NULL;
    assert_parameter_fault(spoilt, "effect made_up, parameter torque has no unit");

    spoilt = SOUND_PARAMETER;
    spoilt.meaning = "";
    assert_parameter_fault(spoilt, "effect made_up, parameter torque has no meaning");

    spoilt = SOUND_PARAMETER;
    spoilt.preset = 2;
    assert_parameter_fault(spoilt, "has a preset outside");
}

static void test_a_parameter_that_contradicts_itself_is_named(void)
{
    bp_parameter_info spoilt = SOUND_PARAMETER;
    spoilt.role = BP_ROLE_SWITCH;
    assert_parameter_fault(spoilt, "is a switch or looks like one");

    spoilt = SOUND_PARAMETER;
    spoilt.role = BP_ROLE_LIMIT;
    assert_parameter_fault(spoilt, "needs `limits`");

    spoilt = SOUND_PARAMETER;
    spoilt.name = "phase";
    assert_parameter_fault(spoilt, "stands for a shape");

    spoilt = SOUND_PARAMETER;
    spoilt.odd = 1;
    spoilt.minimum = -2;
    assert_parameter_fault(spoilt, "is odd");

    spoilt = SOUND_PARAMETER;
    spoilt.optional = 1;
    assert_parameter_fault(spoilt, "asks for a preset of 0");

    spoilt = SOUND_PARAMETER;
    spoilt.scan_count = 5;
    assert_parameter_fault(spoilt, "has a scan");

    spoilt = SOUND_PARAMETER;
    spoilt.arm_of = "mass";
    assert_parameter_fault(spoilt, "names no parameter");

    spoilt = SOUND_PARAMETER;
    spoilt.mechanism = "magic";
    assert_parameter_fault(spoilt, "has a `mechanism`");

    spoilt = SOUND_PARAMETER;
    spoilt.same_as = "torque";
    assert_parameter_fault(spoilt, "names no nominal parameter");
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_every_row_is_complete);
    RUN_TEST(test_every_name_stands_for_one_row);
    RUN_TEST(test_an_effect_of_no_size_leaves_nothing_to_undo);
    RUN_TEST(test_what_can_be_undone_adds_up_over_the_effects_of_a_model);
    RUN_TEST(test_a_sound_row_has_no_fault);
    RUN_TEST(test_a_row_that_lacks_something_is_named);
    RUN_TEST(test_a_prior_that_is_missing_or_copied_is_named);
    RUN_TEST(test_a_row_says_what_to_do_and_what_its_values_mean);
    RUN_TEST(test_what_a_law_contains_are_other_effects);
    RUN_TEST(test_a_variant_that_is_none_is_named);
    RUN_TEST(test_a_parameter_that_lacks_something_is_named);
    RUN_TEST(test_a_parameter_that_contradicts_itself_is_named);
    return UNITY_END();
}
