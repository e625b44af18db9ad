/* affected.h: the preset robot and the same with one effect, run side by side, and what holds for any effect of inputs
 * and motors. */
#ifndef BRICKPILOT_TEST_AFFECTED_H
#define BRICKPILOT_TEST_AFFECTED_H

#include <math.h>
#include <string.h>

#include "plant/plant.h"
#include "unity.h"

static const double STEP = 0.003;

static bp_model *plain, *affected;
static plant_t plant;

static inline void make(int vehicle, int profile)
{
    bp_model_free(plain);
    bp_model_free(affected);
    plain = bp_model_new(vehicle, profile);
    affected = bp_model_new(vehicle, profile);
}

void setUp(void)
{
    make(BP_DIFF_DRIVE, BP_COUPLED);
}
void tearDown(void)
{
    bp_model_free(plain);
    bp_model_free(affected);
    plain = affected = NULL;
}

static inline void use(const char *effect, const double *values)
{
    TEST_ASSERT_EQUAL_INT(0, bp_model_add_effect(affected, effect, values));
}

static inline void set(const char *parameter, double value)
{
    TEST_ASSERT_EQUAL_INT(0, bp_model_set(plain, parameter, value));
    TEST_ASSERT_EQUAL_INT(0, bp_model_set(affected, parameter, value));
}

static inline void start(const bp_model *model, const bp_state *initial)
{
    TEST_ASSERT_EQUAL_INT(0, plant_start(&plant, model, initial, 0, 0));
}

static inline void go(double left, double right, double seconds)
{
    const double input[2] = {left, right};
    for (int i = 0; i < (int)(seconds / STEP + 0.5); i++)
        TEST_ASSERT_EQUAL_INT(0, plant_advance(&plant, input, STEP));
}

/* Ahead, a curve, floating, braking, back: from rest. */
static inline bp_state tour(const bp_model *model, double left, double right)
{
    start(model, NULL);
    go(left, left, 0.6);
    go(left, right, 0.6);
    go(NAN, NAN, 0.15);
    go(0, 0, 0.15);
    go(-left, -right, 0.6);
    return plant.vehicle.state;
}

static inline void assert_same(bp_state a, bp_state b)
{
    TEST_ASSERT_EQUAL_MEMORY(&a, &b, sizeof a);
}

static inline void assert_no_effect(void)
{
    assert_same(tour(plain, 6, 3.3), tour(affected, 6, 3.3));
}

static inline void assert_effect(void)
{
    const bp_state nominal = tour(plain, 6, 3.3), other = tour(affected, 6, 3.3);
    TEST_ASSERT_TRUE(fabs(nominal.wheel_angle[0] - other.wheel_angle[0]) > 0.02);
}

static inline void assert_wheel(const bp_state *a, int k, const bp_state *b, int other, double sign)
{
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, a->wheel_speed[k], sign * b->wheel_speed[other]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, a->wheel_angle[k], sign * b->wheel_angle[other]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, a->current[k], sign * b->current[other]);
}

/* With the inputs swapped and `mirrored` in place of its values, left does what right did. */
static inline void assert_mirror(const char *effect, const double *mirrored)
{
    const bp_state one = tour(affected, 6, 3.3);
    use(effect, mirrored);
    start(affected, NULL);
    go(6, 6, 0.6);
    go(3.3, 6, 0.6);
    go(NAN, NAN, 0.15);
    go(0, 0, 0.15);
    go(-3.3, -6, 0.6);
    const bp_state *other = &plant.vehicle.state;
    assert_wheel(&one, 0, other, 1, 1);
    assert_wheel(&one, 1, other, 0, 1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, one.y, -other->y);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, one.heading, -other->heading);
}

/* With the inputs' signs turned over, everything turns the other way. */
static inline void assert_reversal(void)
{
    const bp_state ahead = tour(affected, 6, 3.3), back = tour(affected, -6, -3.3);
    assert_wheel(&ahead, 0, &back, 0, -1);
    assert_wheel(&ahead, 1, &back, 1, -1);
}

/* A lone motor with a load and the effect of the same values. */
static inline void make_motor(const char *effect, const double *values)
{
    make(BP_MOTOR, BP_COUPLED);
    set("wheel_radius", 0.04);
    set("mass", 0.45);
    use(effect, values);
}

#endif
