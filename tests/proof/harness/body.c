/* Proves the model, for every robot whose coefficients the generator admits. Of a coefficient only `most` is known
 * here: its result for the largest value that it gets. No value gives more, because a product grows with its value
 * (scale.c). admitted() is the generator's condition (coefficients.py: prove_motor and _fits) in the firmware's
 * integers; tests/proof/test_generator.py checks it on the coefficients of robots drawn at random. */
#include "abstract.h"
#include "core/trig.h"
#include "model/body.h"

enum { CURRENT = 0, SPEED = 3, MOTOR = 6, DRAG = 12, SURGE, YAW, THRUST_VOLTAGE, THRUST_WHEEL, YAW_THRUST, ANY };

static const body_coefficients_t coefficients_of; /* used for their addresses alone */
static int32_t most[ANY], current_most[2];
static int32_t speed_most = MOTOR_SPEED_LIMIT_MRAD_S_Q13;

static uint8_t number_of(const scale_t *scale)
{
    const body_coefficients_t *const of = &coefficients_of;
    for (uint8_t i = 0; i < 2; i++) {
        const motor_coefficients_t *const motor = &of->motor[i];
        const scale_t *const all[] = {&motor->current.from_current, &motor->current.from_speed,
                                      &motor->current.from_voltage, &motor->speed.from_current,
                                      &motor->speed.from_speed,     &motor->speed.from_voltage};
        for (uint8_t j = 0; j < 6; j++)
            if (scale == all[j])
                return (uint8_t)(MOTOR * i + j);
    }
    return scale == &of->drag                   ? DRAG
           : scale == &of->surge_from_wheel     ? SURGE
           : scale == &of->yaw_rate_from_wheel  ? YAW
           : scale == &of->thrust_from_voltage  ? THRUST_VOLTAGE
           : scale == &of->thrust_from_wheel    ? THRUST_WHEEL
           : scale == &of->yaw_rate_from_thrust ? YAW_THRUST
                                                : ANY;
}

/* The largest value that this coefficient gets. */
static int32_t domain_of(uint8_t number)
{
    if (number < DRAG && number % 3 == 2)
        return 2L * MOTOR_VOLTAGE_LIMIT_MV;
    if (number < DRAG && number % 3 == 0)
        return current_most[number / MOTOR];
    if (number == DRAG)
        return 16380L * 16380L;
    return number == THRUST_VOLTAGE                ? MOTOR_VOLTAGE_LIMIT_MV
           : number == YAW_THRUST || number == ANY ? FIX_INT32_MAX
                                                   : speed_most;
}

static int32_t open_scale(const scale_t *scale, int32_t value)
{
    const uint8_t number = number_of(scale);
    int32_t result;

    ASSERT(number >= YAW_THRUST || UP_TO(domain_of(number), value));
    if (number == ANY) /* a scale of part(): mantissa below 2^15, result at most 3/4 of a unit off */
        ASSUME(fix_abs_u32(result) <= (fix_abs_u32(value) >> scale->shift) + (scale->shift != 0));
    else
        ASSUME(UP_TO(most[number], result));
    return result;
}

static int32_t open_scale16(const scale_t *scale, int16_t value)
{
    return open_scale(scale, value);
}

#define scale_apply open_scale
#define scale_apply16 open_scale16
#define trig_cos_q15 open_cosine
#define trig_sin_q15 open_cosine
#define trig_atan2_bam16 open_angle
#include "model/motor.c"
#undef sum
#include "model/body.c"

/* True for coefficients that the generator admits. The sums have 64 bits, so that none overflows here. */
static bool admitted(bool paper)
{
    long long sum;
    for (uint8_t i = 0; i < 2; i++) {
        const int32_t *const of = &most[MOTOR * i];
        sum = (long long)of[0] + of[1] + of[2];
        if (sum > current_most[i] || current_most[i] > (paper ? FIX_INT32_MAX : FIX_INT32_MAX / 2))
            return false;
        sum = (long long)of[3] + of[4] + of[5] + (paper ? 0 : 163840000L) + speed_most;
        if (sum > FIX_INT32_MAX)
            return false;
    }
    for (uint8_t i = 0; i < ANY; i++)
        if (most[i] < 0)
            return false;
    if (!paper)
        return most[DRAG] <= 163840000L && most[SURGE] <= BODY_SPEED_LIMIT_MM_S_Q17;
    const long long thrust = 2 * ((long long)most[THRUST_VOLTAGE] + most[THRUST_WHEEL]);
    return thrust <= FIX_INT32_MAX &&
           BODY_SPEED_LIMIT_MM_S_Q17 + thrust / 128 + 2 * (long long)most[DRAG] + 4 <= FIX_INT32_MAX;
}

static bool body_holds(const body_state_t *of, bool paper)
{
    for (uint8_t i = 0; i < 2; i++)
        if (!UP_TO(current_most[i], of->motor[i].current_ua_q7) || !UP_TO(speed_most, of->motor[i].speed_mrad_s_q13))
            return false;
    if (!UP_TO(BODY_SPEED_LIMIT_MM_S_Q17, of->motion.surge_mm_s_q17))
        return false;
    return !paper || (UP_TO(BODY_SPEED_LIMIT_MM_S_Q17, of->motion.sway_mm_s_q17) &&
                      UP_TO(BODY_SPEED_LIMIT_MM_S_Q17, of->velocity_x_mm_s_q17) &&
                      UP_TO(BODY_SPEED_LIMIT_MM_S_Q17, of->velocity_y_mm_s_q17) &&
                      UP_TO(BODY_YAW_RATE_LIMIT_MRAD_S_Q12, of->motion.yaw_rate_mrad_s_q12));
}

static void any_model(void)
{
    for (uint8_t i = 0; i < ANY; i++) {
        int32_t any;
        most[i] = any;
    }
    for (uint8_t i = 0; i < 2; i++) {
        int32_t any;
        current_most[i] = any;
    }
}

void body_coupled_predict(void)
{
    body_state_t state;
    int16_t left_mv, right_mv;

    any_model();
    ASSUME(admitted(false) && body_holds(&state, false));
    body_predict(&coefficients_of, &state, left_mv, right_mv); /* coefficients_of is all zero: BODY_COUPLED */
    ASSERT(body_holds(&state, false));
    END();
}

void body_coupled_correct(void)
{
    body_state_t state;
    int32_t change;

    any_model();
    ASSUME(admitted(false) && body_holds(&state, false));
    body_correct_surge(&coefficients_of, &state, change);
    ASSERT(body_holds(&state, false));
    END();
}

void body_paper_predict(void)
{
    body_state_t state;
    int16_t left_mv, right_mv;

    any_model();
    ASSUME(admitted(true) && body_holds(&state, true));
    predict_paper(&coefficients_of, &state, fix_clamp16(left_mv, MOTOR_VOLTAGE_LIMIT_MV),
                  fix_clamp16(right_mv, MOTOR_VOLTAGE_LIMIT_MV));
    ASSERT(body_holds(&state, true));
    END();
}
