/* Proves that left and right are treated alike: with y and all turns negated, the demand turns the other way. Products,
 * sines, angles and roots are any functions with the symmetry of the real ones (fix.c, mirror.h, exhaustive.c,
 * trig_mirror() below). */
#include "contracts.h"
#include "core/fix.h"
#include "core/turns.h"

uint32_t __CPROVER_uninterpreted_product(uint32_t, uint32_t);
uint32_t __CPROVER_uninterpreted_thousandth(uint32_t);
uint16_t __CPROVER_uninterpreted_sine(uint16_t);
uint16_t __CPROVER_uninterpreted_angle(uint32_t, int32_t);
uint16_t __CPROVER_uninterpreted_root(uint32_t);
uint32_t __CPROVER_uninterpreted_scaled(uint32_t, uint32_t);
uint32_t __CPROVER_uninterpreted_quotient(uint32_t, uint32_t);

/* Odd in each factor; neither is -32768. */
static int32_t odd_mul(int16_t a, int16_t b)
{
    const uint32_t magnitude = __CPROVER_uninterpreted_product(fix_abs_u16(a), fix_abs_u16(b));

    ASSUME(magnitude <= 32767UL * 32767UL && ((a != 0 && b != 0) || magnitude == 0));
    return (a < 0) != (b < 0) ? -(int32_t)magnitude : (int32_t)magnitude;
}

static int32_t odd_dot(const fix_vector_t *of, const fix_vector_t *with)
{
    return odd_mul(of->x, with->x) + odd_mul(of->y, with->y);
}

static int16_t odd_along(const fix_vector_t *of, const fix_vector_t *direction_q15)
{
    return fix_round_shift16(odd_dot(of, direction_q15), 15);
}

static int16_t odd_thousandth(int32_t value)
{
    const uint32_t magnitude = __CPROVER_uninterpreted_thousandth(fix_abs_u32(value));

    ASSUME(magnitude <= 32767UL && (value != 0 || magnitude == 0));
    return (int16_t)(value < 0 ? -(int32_t)magnitude : (int32_t)magnitude);
}

/* Odd, and negated by half a turn: so cosines are even. */
static int16_t odd_sine(uint16_t angle)
{
    const uint16_t half = angle & (TURN_HALF - 1), across = half > TURN_QUARTER ? (uint16_t)(TURN_HALF - half) : half;
    const uint16_t sine = __CPROVER_uninterpreted_sine(across);

    ASSUME(sine <= 32767U && (across != 0 || sine == 0));
    return (int16_t)(angle >= TURN_HALF ? -(int32_t)sine : (int32_t)sine);
}

static int16_t odd_cosine(uint16_t angle)
{
    return odd_sine((uint16_t)(angle + TURN_QUARTER));
}

/* Odd in y; 0 or half a turn where y is 0. */
static uint16_t odd_angle(int32_t y, int32_t x)
{
    const uint16_t angle = __CPROVER_uninterpreted_angle(fix_abs_u32(y), x);

    ASSUME(y != 0 || angle == (x < 0 ? TURN_HALF : 0U));
    return y < 0 ? (uint16_t)(0U - angle) : angle;
}

static uint16_t same_root(uint32_t value)
{
    return __CPROVER_uninterpreted_root(value);
}

static uint32_t same_mul_u16(uint16_t a, uint16_t b)
{
    return __CPROVER_uninterpreted_scaled(a, b);
}

static int16_t same_compare_square(int32_t value, uint16_t root)
{
    const int32_t square = (int32_t)__CPROVER_uninterpreted_scaled(root, root);
    return value < square ? -1 : value > square;
}

#define fix_mul odd_mul
#define fix_dot odd_dot
#define fix_project odd_along
#define fix_div_1000 odd_thousandth
#define trig_sin_q15 odd_sine
#define trig_cos_q15 odd_cosine
#define trig_atan2_bam16 odd_angle
#define fix_sqrt_u32 same_root
#define fix_mul_u16 same_mul_u16
#define fix_compare_square same_compare_square
#include "autopilot/los.c"
#undef trig_sin_q15
#undef trig_cos_q15
#undef trig_atan2_bam16

static uint32_t same_div_u32(uint32_t dividend, uint16_t divisor)
{
    return __CPROVER_uninterpreted_quotient(dividend, divisor);
}
#define fix_div_u32 same_div_u32
#include "core/trig.c"

static bool opposite(int32_t a, int32_t b)
{
    return b >= -FIX_INT32_MAX && a == -b;
}

/* True if two angles are opposite: half a turn is its own opposite. */
static bool turned(uint16_t a, uint16_t b)
{
    return (uint16_t)(a + b) == 0;
}

/* True if two states are mirror images of each other: the left of one is the right of the other. */
static bool mirrors(const los_state_t *a, const los_state_t *b)
{
    return a->to_mm.x == b->to_mm.x && opposite(a->to_mm.y, b->to_mm.y) && a->to_x_um == b->to_x_um &&
           opposite(a->to_y_um, b->to_y_um) && a->distance_squared_mm2 == b->distance_squared_mm2 &&
           turned(a->sight_bam16, b->sight_bam16) && a->phase == b->phase && a->status == b->status &&
           a->waypoint == b->waypoint && a->skipped == b->skipped && a->last_reached == b->last_reached &&
           a->passing == b->passing && a->leg_overshoots == b->leg_overshoots && a->overshoots == b->overshoots &&
           turned(a->bearing_bam16, b->bearing_bam16) &&
           turned((uint16_t)a->heading_error_bam16, (uint16_t)b->heading_error_bam16) &&
           opposite(a->cross_track_mm, b->cross_track_mm) && a->pass_q15.x == b->pass_q15.x &&
           opposite(a->pass_q15.y, b->pass_q15.y) && opposite(a->left_q15.x, b->left_q15.x) &&
           a->left_q15.y == b->left_q15.y && turned(a->hold_heading_bam16, b->hold_heading_bam16) &&
           a->quiet_ms == b->quiet_ms && a->leg_ms == b->leg_ms;
}

void los_mirror(void)
{
    parameters_t parameters;
    const los_config_t *const config = &parameters.config.step.mode.los;
    route_waypoint_t waypoints[ROUTE_WAYPOINTS_MAX], others[ROUTE_WAYPOINTS_MAX];
    route_t route, other_route;
    los_state_t los, other;
    signals_estimate_t estimate, image;
    signals_demand_t demand, other_demand;

    route.waypoints = waypoints;
    other_route.waypoints = others;
    other_route.count = route.count;
    ASSUME(settings_hold(&parameters) && route_holds(&route) && los_holds(&los, &route) && mirrors(&los, &other));
    for (uint8_t i = 0; i < ROUTE_WAYPOINTS_MAX; i++) {
        others[i].x_mm = waypoints[i].x_mm;
        ASSUME(waypoints[i].y_mm >= -32767);
        others[i].y_mm = (int16_t)-waypoints[i].y_mm;
    }
    ASSUME(WITHIN(signals_estimate_t_period_ms, estimate.period_ms));
    /* The most negative number has no mirror image. */
    ASSUME(estimate.y_um >= -FIX_INT32_MAX && estimate.yaw_rate_mrad_s >= -32767);
    image = estimate;
    image.y_um = -estimate.y_um;
    image.heading_bam16 = (uint16_t)(0U - estimate.heading_bam16);
    image.yaw_rate_mrad_s = (int16_t)-estimate.yaw_rate_mrad_s;
    los_step(config, &route, &los, &estimate, &demand);
    los_step(config, &other_route, &other, &image, &other_demand);
    ASSERT(mirrors(&los, &other));
    ASSERT(demand.speed_mm_s_q4 == other_demand.speed_mm_s_q4);
    ASSERT(turned(demand.heading_bam16, other_demand.heading_bam16));
    END();
}

void trig_mirror(void)
{
    int32_t x, y;

    ASSUME(y >= -FIX_INT32_MAX);
    ASSERT(turned(trig_atan2_bam16(-y, x), trig_atan2_bam16(y, x)));
    END();
}
