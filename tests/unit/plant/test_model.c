#include <math.h>
#include <string.h>

#include "plant/model.h"
#include "unity.h"

static bp_model *model;

void setUp(void)
{
    model = bp_model_new(BP_DIFF_DRIVE, BP_COUPLED);
}
void tearDown(void)
{
    bp_model_free(model);
}

/* A skid steer has every parameter; the other vehicles lack those of its contacts. */
static void test_model_starts_with_the_presets(void)
{
    bp_model_free(model);
    model = bp_model_new(BP_SKID_STEER, BP_COUPLED);
    for (int i = 0; bp_parameter(i) != NULL; i++) {
        double value = NAN;
        TEST_ASSERT_EQUAL_INT(0, bp_model_get(model, bp_parameter(i)->name, &value));
        TEST_ASSERT_EQUAL_DOUBLE(bp_parameter(i)->preset, value);
        TEST_ASSERT_TRUE(value >= bp_parameter(i)->minimum && value <= bp_parameter(i)->maximum);
    }
    TEST_ASSERT_NULL(bp_parameter(-1));
}

static void test_model_refuses_unknown_names_and_values_beyond_physics(void)
{
    double value = 0;
    TEST_ASSERT_EQUAL_INT(BP_E_NAME, bp_model_set(model, "weight", 1));
    TEST_ASSERT_EQUAL_INT(BP_E_NAME, bp_model_get(model, "weight", &value));
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_model_set(model, "mass", -1));
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_model_set(model, "mass", 0));
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_model_set(model, "mass", NAN));
    TEST_ASSERT_EQUAL_INT(0, bp_model_get(model, "mass", &value));
    TEST_ASSERT_EQUAL_DOUBLE(0.9, value);
    TEST_ASSERT_NULL(bp_model_new(7, BP_COUPLED));
    TEST_ASSERT_NULL(bp_model_new(BP_MOTOR, -1));
}

static void test_model_of_a_motor_has_no_load_until_one_is_set(void)
{
    bp_model *motor = bp_model_new(BP_MOTOR, BP_COUPLED);
    double value = 1;
    TEST_ASSERT_EQUAL_INT(0, bp_model_get(motor, "mass", &value));
    TEST_ASSERT_EQUAL_DOUBLE(0, value);
    TEST_ASSERT_EQUAL_INT(0, bp_model_set(motor, "mass", 0));
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_model_set(motor, "resistance", 0));
    bp_model_free(motor);
}

static void test_model_keeps_effects_in_the_order_of_the_table(void)
{
    const double value[] = {0.25, 0};
    TEST_ASSERT_EQUAL_INT(0, bp_model_add_effect(model, "coulomb_friction", value));
    TEST_ASSERT_EQUAL_INT(0, bp_model_add_effect(model, "actuator_deadband", value));
    TEST_ASSERT_EQUAL_INT(2, model->effect_count);
    TEST_ASSERT_EQUAL_STRING("actuator_deadband", model->effect[0].effect->info.name);
    TEST_ASSERT_EQUAL_STRING("coulomb_friction", model->effect[1].effect->info.name);
}

static void test_model_replaces_and_removes_effects(void)
{
    const double small = 0.1, large = 0.2;
    TEST_ASSERT_EQUAL_INT(0, bp_model_add_effect(model, "coulomb_friction", &small));
    TEST_ASSERT_EQUAL_INT(0, bp_model_add_effect(model, "coulomb_friction", &large));
    TEST_ASSERT_EQUAL_INT(1, model->effect_count);
    TEST_ASSERT_EQUAL_DOUBLE(0.2, model->effect[0].value[0]);
    bp_model *copy = bp_model_copy(model);
    TEST_ASSERT_EQUAL_INT(0, bp_model_remove_effect(model, "coulomb_friction"));
    TEST_ASSERT_EQUAL_INT(BP_E_NAME, bp_model_remove_effect(model, "coulomb_friction"));
    TEST_ASSERT_EQUAL_INT(0, model->effect_count);
    TEST_ASSERT_EQUAL_INT(1, copy->effect_count);
    bp_model_free(copy);
}

static void test_model_refuses_effects_it_does_not_know_or_values_out_of_range(void)
{
    const double negative = -0.1, lost = NAN;
    TEST_ASSERT_EQUAL_INT(BP_E_NAME, bp_model_add_effect(model, "glue", &negative));
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_model_add_effect(model, "coulomb_friction", &negative));
    TEST_ASSERT_EQUAL_INT(BP_E_RANGE, bp_model_add_effect(model, "coulomb_friction", &lost));
    TEST_ASSERT_EQUAL_INT(0, model->effect_count);
}

static void test_every_effect_row_is_whole(void)
{
    for (int i = 0; bp_effect(i) != NULL; i++) {
        const bp_effect_info *info = bp_effect(i);
        TEST_ASSERT_EQUAL_INT(i, effect_index(info->name));
        TEST_ASSERT_TRUE(strlen(info->acts_on) > 0 && strlen(info->equation) > 0 && strlen(info->source) > 0);
        TEST_ASSERT_TRUE(info->parameter_count >= 1 && info->parameter_count <= BP_MAX_PARAMETERS);
        for (int k = 0; k < info->parameter_count; k++)
            TEST_ASSERT_TRUE(info->parameters[k].minimum <= info->parameters[k].preset &&
                             info->parameters[k].preset <= info->parameters[k].maximum);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_model_starts_with_the_presets);
    RUN_TEST(test_model_refuses_unknown_names_and_values_beyond_physics);
    RUN_TEST(test_model_of_a_motor_has_no_load_until_one_is_set);
    RUN_TEST(test_model_keeps_effects_in_the_order_of_the_table);
    RUN_TEST(test_model_replaces_and_removes_effects);
    RUN_TEST(test_model_refuses_effects_it_does_not_know_or_values_out_of_range);
    RUN_TEST(test_every_effect_row_is_whole);
    return UNITY_END();
}
