/* drive.h: one vehicle to switch effects on, to start and to drive; and the numbers closed forms need. */
#ifndef BRICKPILOT_TEST_DRIVE_H
#define BRICKPILOT_TEST_DRIVE_H

#include <math.h>

#include "plant/plant.h"
#include "unity.h"

static const double MASS = 0.9, YAW_INERTIA = 0.006, RADIUS = 0.0408, HALF_TRACK = 0.07, WHEEL_INERTIA = 1e-4;
static const double GAIN = 0.195 / 22;             /* N m at the wheel per V at stall */
static const double EMF_LOSS = 0.195 * 0.245 / 22; /* N m s/rad of a shorted motor */
static const double BODY_STEP = 0.003, GRAVITY = 9.81;

static bp_model *model;
static plant_t plant;
static double out[OUTPUT_COUNT];

static inline void set(const char *name, double value)
{
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, bp_model_set(model, name, value), name);
}

/* Removes all losses, so that a vehicle coasts for ever unless the test adds some. */
static inline void without_losses(void)
{
    set("rolling_friction", 0);
    set("viscous_friction", 0);
    set("drag_area", 0);
}

/* A new vehicle without losses. */
static inline void vehicle(int kind, int profile)
{
    bp_model_free(model);
    model = bp_model_new(kind, profile);
    without_losses();
}

/* A linear axis: 50 N/V on 100 kg. */
static inline void axis(void)
{
    vehicle(BP_MOTOR, BP_COUPLED);
    set("force_per_volt", 50);
    set("mass", 100);
}

static inline void on(const char *effect, double first, double second, double third)
{
    const double values[BP_MAX_PARAMETERS] = {first, second, third};
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, bp_model_add_effect(model, effect, values), effect);
}

static inline const bp_state *state(void)
{
    return &plant.vehicle.state;
}

/* initial: NULL is at rest. */
static inline void start(const bp_state *initial)
{
    TEST_ASSERT_EQUAL_INT(0, plant_start(&plant, model, initial, 0, 0));
    plant_outputs(&plant, out);
}

static inline void go(double left, double right, double seconds)
{
    const double input[2] = {left, right};
    for (int i = 0; i < (int)(seconds / BODY_STEP + 0.5); i++)
        TEST_ASSERT_EQUAL_INT(0, plant_advance(&plant, input, BODY_STEP));
    plant_outputs(&plant, out);
}

static inline void coast(double surge, double yaw_rate, double seconds)
{
    const bp_state moving = {.surge = surge, .yaw_rate = yaw_rate};
    start(&moving);
    go(NAN, NAN, seconds);
}

/* What a force on the body, and a moment, have to move. */
static inline double surge_mass(void)
{
    return MASS + 2 * WHEEL_INERTIA / (RADIUS * RADIUS);
}

static inline double turn_inertia(void)
{
    return YAW_INERTIA + 2 * WHEEL_INERTIA * HALF_TRACK * HALF_TRACK / (RADIUS * RADIUS);
}

/* A drive with curves, stops, floating and reversal. */
static inline bp_state tour(void)
{
    start(NULL);
    go(5, 3, 0.3);
    go(-4, 6, 0.3);
    go(NAN, 2, 0.15);
    go(0, 0, 0.15);
    go(-3, -6, 0.3);
    return *state();
}

/* With these values the effect is off to the last bit. */
static inline void assert_off(const char *effect, double first, double second, double third)
{
    const bp_state before = tour();
    on(effect, first, second, third);
    const bp_state after = tour();
    TEST_ASSERT_EQUAL_MEMORY(&before, &after, sizeof before);
    TEST_ASSERT_EQUAL_INT(0, bp_model_remove_effect(model, effect));
}

/* A motor without a floor under it does not know the effect. */
static inline void assert_not_of_a_motor(const char *effect, double first, double second, double third)
{
    axis();
    assert_off(effect, first, second, third);
}

#endif
