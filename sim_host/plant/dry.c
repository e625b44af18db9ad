#include "plant/dry.h"

#include <math.h>
#include <stdbool.h>

/* Share by which rounding may exceed a bound where two cases meet. */
static const double SLACK = 1e-12;

typedef struct {
    double left, right;
} vector_t;

static const vector_t MOTION[DRY_COUNT] = {{1, 0}, {0, 1}, {1, 1}, {1, -1}};
static const vector_t ALONG[DRY_COUNT] = {{0, 1}, {1, 0}, {1, -1}, {1, 1}}; /* speeds at which that motion is zero */

/* One speed inside each sector between the lines on which a motion is zero. */
static const vector_t SECTOR[] = {{2, 1}, {1, 2}, {-1, 2}, {-2, 1}, {-2, -1}, {-1, -2}, {1, -2}, {2, -1}};

static double dot(vector_t a, vector_t b)
{
    return a.left * b.left + a.right * b.right;
}

static vector_t multiply(const pair_t *matrix, vector_t v)
{
    return (vector_t){matrix->left * v.left + matrix->cross * v.right,
                      matrix->right * v.right + matrix->cross * v.left};
}

static double sign(double value)
{
    return value > 0 ? 1 : value < 0 ? -1 : 0;
}

/* The sum of the impulses that oppose the motions of `w`. */
static vector_t opposing(vector_t w, const double bound[DRY_COUNT])
{
    double along[DRY_COUNT];
    for (int i = 0; i < DRY_COUNT; i++)
        along[i] = bound[i] * sign(dot(MOTION[i], w));
    return (vector_t){along[DRY_LEFT] + along[DRY_SURGE] + along[DRY_YAW],
                      along[DRY_RIGHT] + along[DRY_SURGE] - along[DRY_YAW]};
}

/* Supposes that every motion slips in its direction of `guess`. True where the speeds that follow agree with that. */
static bool slips(vector_t guess, vector_t *w, vector_t free, const pair_t *inverse, const double bound[DRY_COUNT])
{
    const vector_t change = multiply(inverse, opposing(guess, bound));
    *w = (vector_t){free.left - change.left, free.right - change.right};
    for (int i = 0; i < DRY_COUNT; i++)
        if (bound[i] > 0 && !(dot(MOTION[i], *w) * dot(MOTION[i], guess) > 0))
            return false;
    return true;
}

/* True where all stands still: in no direction of motion does the impulse exceed what the bounds hold. */
static bool sticks(vector_t impulse, const double bound[DRY_COUNT])
{
    for (int j = 0; j < DRY_COUNT; j++) {
        double held = 0;
        for (int i = 0; i < DRY_COUNT; i++)
            held += bound[i] * fabs(dot(ALONG[j], MOTION[i]));
        if (fabs(dot(ALONG[j], impulse)) > held)
            return false;
    }
    return true;
}

/* Supposes that motion j is held at zero and the others slip. True where the impulse that holds it is within its
 * bound. */
static bool holds(int j, vector_t *w, vector_t impulse, const pair_t *matrix, const double bound[DRY_COUNT])
{
    const vector_t along = ALONG[j];
    const double direction = sign(dot(along, impulse));
    const vector_t way = {direction * along.left, direction * along.right};
    const double push = dot(way, impulse) - dot(way, opposing(way, bound));
    if (!(push > 0))
        return false;
    const double speed = push / dot(way, multiply(matrix, way));
    *w = (vector_t){speed * way.left, speed * way.right};

    const vector_t used = multiply(matrix, *w), opposed = opposing(way, bound);
    const vector_t rest = {impulse.left - used.left - opposed.left, impulse.right - used.right - opposed.right};
    return fabs(dot(MOTION[j], rest)) <= bound[j] * (1 + SLACK) * dot(MOTION[j], MOTION[j]);
}

static vector_t solve(vector_t free, const pair_t *matrix, const pair_t *inverse, const double bound[DRY_COUNT])
{
    vector_t w;
    if (slips(free, &w, free, inverse, bound))
        return w;
    const vector_t impulse = multiply(matrix, free);
    if (sticks(impulse, bound))
        return (vector_t){0, 0};
    for (int j = 0; j < DRY_COUNT; j++)
        if (bound[j] > 0 && holds(j, &w, impulse, matrix, bound))
            return w;
    for (int i = 0; i < (int)(sizeof SECTOR / sizeof SECTOR[0]); i++)
        if (slips(SECTOR[i], &w, free, inverse, bound))
            return w;
    return (vector_t){0, 0}; /* reached only by rounding at the edge of sticking */
}

void dry_solve(double w[2], const pair_t *matrix, const pair_t *inverse, const double bound[DRY_COUNT])
{
    const vector_t solution = solve((vector_t){w[0], w[1]}, matrix, inverse, bound);
    w[0] = solution.left;
    w[1] = solution.right;
}
