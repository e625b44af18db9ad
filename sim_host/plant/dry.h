/* dry.h: dry friction of two coupled wheels, solved exactly within a motor step.
 *
 * The wheel speeds w minimise 1/2 (w - f)' A (w - f) + sum_i c_i |d_i . w|. Here f are the speeds without dry friction,
 * and d_i are the four motions of dry_t: left (1, 0), right (0, 1), surge (1, 1), yaw (1, -1). On each motion acts its
 * full bound as an opposing impulse, or the smaller impulse that holds the motion at exactly zero. c_i is the sum of
 * the bounds of all effects.
 */
#ifndef BRICKPILOT_PLANT_DRY_H
#define BRICKPILOT_PLANT_DRY_H

#include "effects/vehicle.h"

/* A symmetric 2 x 2 matrix. */
typedef struct {
    real_t left;  /* element (left, left) */
    real_t right; /* element (right, right) */
    real_t cross;
} pair_t;

/* Fraction by which rounding may exceed a bound at the limit between two cases. */
static const double DRY_SLACK = 1e-12;

typedef struct {
    real_t left, right;
} dry_vector_t;

typedef struct {
    double left, right;
} dry_way_t;

static const dry_way_t DRY_MOTION[DRY_COUNT] = {{1, 0}, {0, 1}, {1, 1}, {1, -1}};
static const dry_way_t DRY_ALONG[DRY_COUNT] = {{0, 1}, {1, 0}, {1, -1}, {1, 1}}; /* speeds with motion i zero */

/* The lines on which a motion is zero divide the plane of speeds into sectors. One pair of speeds in each sector: */
static const dry_way_t DRY_SECTOR[] = {{2, 1}, {1, 2}, {-1, 2}, {-2, 1}, {-2, -1}, {-1, -2}, {1, -2}, {2, -1}};

static inline dry_vector_t dry_vector(dry_way_t way)
{
    return (dry_vector_t){real_of(way.left), real_of(way.right)};
}

static inline real_t dry_dot(dry_way_t a, dry_vector_t b)
{
    return a.left * b.left + a.right * b.right;
}

static inline real_t dry_dots(dry_vector_t a, dry_vector_t b)
{
    return a.left * b.left + a.right * b.right;
}

static inline dry_vector_t dry_multiply(const pair_t *matrix, dry_vector_t v)
{
    return (dry_vector_t){matrix->left * v.left + matrix->cross * v.right,
                          matrix->right * v.right + matrix->cross * v.left};
}

static inline dry_vector_t dry_choose(mask_t mask, dry_vector_t yes, dry_vector_t no)
{
    return (dry_vector_t){choose(mask, yes.left, no.left), choose(mask, yes.right, no.right)};
}

/* The sum of the impulses that oppose the motions of `w`. */
static inline dry_vector_t dry_opposing(dry_vector_t w, const real_t bound[DRY_COUNT])
{
    real_t along[DRY_COUNT];
    for (int i = 0; i < DRY_COUNT; i++)
        along[i] = bound[i] * real_sign(dry_dot(DRY_MOTION[i], w));
    return (dry_vector_t){along[DRY_LEFT] + along[DRY_SURGE] + along[DRY_YAW],
                          along[DRY_RIGHT] + along[DRY_SURGE] - along[DRY_YAW]};
}

/* Assumes that every motion slips in the direction that it has in `guess`. True if the resulting speeds agree. */
static inline mask_t dry_slips(dry_vector_t guess, dry_vector_t *w, dry_vector_t free, const pair_t *inverse,
                               const real_t bound[DRY_COUNT])
{
    const dry_vector_t change = dry_multiply(inverse, dry_opposing(guess, bound));
    *w = (dry_vector_t){free.left - change.left, free.right - change.right};
    mask_t agree = mask_of(1);
    for (int i = 0; i < DRY_COUNT; i++) {
        const mask_t same_way = dry_dot(DRY_MOTION[i], *w) * dry_dot(DRY_MOTION[i], guess) > 0;
        agree &= mask_not(bound[i] > 0) | same_way;
    }
    return agree;
}

/* True if all motions stand still: in no direction of motion does the impulse exceed what the bounds can hold. */
static inline mask_t dry_sticks(dry_vector_t impulse, const real_t bound[DRY_COUNT])
{
    mask_t moves = mask_of(0);
    for (int j = 0; j < DRY_COUNT; j++) {
        const dry_way_t along = DRY_ALONG[j];
        real_t held = real_of(0);
        for (int i = 0; i < DRY_COUNT; i++)
            held += bound[i] * fabs(along.left * DRY_MOTION[i].left + along.right * DRY_MOTION[i].right);
        moves |= real_abs(dry_dot(along, impulse)) > held;
    }
    return mask_not(moves);
}

/* Assumes that motion j is held at zero and the others slip. True if the impulse that holds motion j is within its
 * bound. */
static inline mask_t dry_holds(int j, dry_vector_t *w, dry_vector_t impulse, const pair_t *matrix,
                               const real_t bound[DRY_COUNT])
{
    const dry_way_t along = DRY_ALONG[j], motion = DRY_MOTION[j];
    const real_t direction = real_sign(dry_dot(along, impulse));
    const dry_vector_t way = {direction * along.left, direction * along.right};
    const dry_vector_t opposed = dry_opposing(way, bound);
    const real_t push = dry_dots(way, impulse) - dry_dots(way, opposed);
    const real_t speed = push / dry_dots(way, dry_multiply(matrix, way));
    *w = (dry_vector_t){speed * way.left, speed * way.right};

    const dry_vector_t used = dry_multiply(matrix, *w);
    const dry_vector_t rest = {impulse.left - used.left - opposed.left, impulse.right - used.right - opposed.right};
    const double length = motion.left * motion.left + motion.right * motion.right;
    const mask_t within = real_abs(dry_dot(motion, rest)) <= bound[j] * (1 + DRY_SLACK) * length;
    return (bound[j] > 0) & (push > 0) & within;
}

static inline dry_vector_t dry_solution(dry_vector_t free, const pair_t *matrix, const pair_t *inverse,
                                        const real_t bound[DRY_COUNT])
{
    dry_vector_t w, found;
    mask_t done = dry_slips(free, &found, free, inverse, bound);
    if (all_lanes(done))
        return found;
    const dry_vector_t still = {real_of(0), real_of(0)};
    const dry_vector_t impulse = dry_multiply(matrix, free);
    found = dry_choose(done, found, still); /* the result if all motions stick, or if rounding lets no case below fit */
    done |= dry_sticks(impulse, bound);
    for (int j = 0; j < DRY_COUNT && !all_lanes(done); j++) {
        const mask_t holds = dry_holds(j, &w, impulse, matrix, bound) & mask_not(done);
        found = dry_choose(holds, w, found);
        done |= holds;
    }
    for (int i = 0; i < (int)(sizeof DRY_SECTOR / sizeof DRY_SECTOR[0]) && !all_lanes(done); i++) {
        const mask_t slips = dry_slips(dry_vector(DRY_SECTOR[i]), &w, free, inverse, bound) & mask_not(done);
        found = dry_choose(slips, w, found);
        done |= slips;
    }
    return found;
}

/* Replaces the speeds w without dry friction by the speeds with dry friction. matrix is A, positive definite; inverse
 * is the inverse of A; bound holds c_i >= 0 in N m s. */
APART void dry_solve(real_t w[2], const pair_t *matrix, const pair_t *inverse, const real_t bound[DRY_COUNT])
{
    const dry_vector_t solution = dry_solution((dry_vector_t){w[0], w[1]}, matrix, inverse, bound);
    w[0] = solution.left;
    w[1] = solution.right;
}

#endif
