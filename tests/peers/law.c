#include "law.h"

#include "constants.inc"

typedef struct {
    num kp, ki, kd, limit; /* ki times the period */
} gains_t;

typedef struct {
    num integral;
    int8_t saturated; /* the mixer's answer to the last output: 1 gave less than asked, -1 more, 0 gave it in full */
} pid_t;

static const num waypoints[][2] = {WAYPOINTS_SI};
static const gains_t speed_gains = {NUM(SPEED_KP), NUM(SPEED_KI_PERIOD), NUM(SPEED_KD), NUM(SPEED_LIMIT)};
static const gains_t heading_gains = {NUM(HEADING_KP), NUM(HEADING_KI_PERIOD), NUM(HEADING_KD), NUM(HEADING_LIMIT)};

static pid_t speed_pid, heading_pid;
static num bearing, hold_heading;
static uint8_t last_phase;

static num magnitude(num value)
{
    return value < 0 ? -value : value;
}

static num clamp(num value, num limit)
{
    if (value > limit)
        return limit;
    return value < -limit ? -limit : value;
}

static num wrapped(num angle)
{
    if (angle > NUM(PI))
        return angle - NUM(2 * PI);
    return angle < NUM(-PI) ? angle + NUM(2 * PI) : angle;
}

/* The speed from which the robot can still brake. The firmware leaves the root out where the larger coordinate alone allows cruise; so does
 * this. */
static num approach_speed(num x, num y, num distance_squared)
{
    const num along_x = magnitude(x), along_y = magnitude(y);
    num speed;

    if (num_mul(along_x > along_y ? along_x : along_y, NUM(TWICE_DECEL)) > NUM(CRUISE_SQUARED))
        return NUM(CRUISE);
    speed = num_sqrt(num_mul(num_sqrt(distance_squared), NUM(TWICE_DECEL)));
    if (speed > NUM(CRUISE))
        return NUM(CRUISE);
    return speed < NUM(CREEP) ? NUM(CREEP) : speed;
}

/* Sets the bearings, and returns the demanded speed. Eq. 22. */
static num look(const record_t *record)
{
    const num x = waypoints[record->waypoint][0] - record->x, y = waypoints[record->waypoint][1] - record->y;
    const num distance_squared = num_mul(x, x) + num_mul(y, y), sight = num_atan2(y, x);

    if (record->phase == PHASE_BRAKE && last_phase != PHASE_BRAKE)
        hold_heading = record->heading;
    if (record->phase == PHASE_BRAKE || distance_squared > NUM(BEARING_HOLD_SQUARED))
        bearing = sight;
    last_phase = record->phase;
    return record->phase == PHASE_DRIVE ? approach_speed(x, y, distance_squared) : NUM(0);
}

/* Eq. 21, derivative on the measurement; the integrator is held in the direction that meets a limit. */
static num pid(const gains_t *gains, pid_t *state, num error, num rate, num feedforward)
{
    const num wanted = num_mul(gains->kp, error) - num_mul(gains->kd, rate) + state->integral + feedforward;
    const num given = clamp(wanted, gains->limit), change = num_mul(gains->ki, error);
    const uint8_t above = wanted > given || state->saturated > 0, below = wanted < given || state->saturated < 0;

    if (!(above && change > 0) && !(below && change < 0))
        state->integral = clamp(state->integral + change, gains->limit);
    return given;
}

static int8_t excess(num asked, num given)
{
    return (int8_t)((asked > given) - (asked < given));
}

/* Yaw gets what voltage there is, surge what is left. */
static void mix(num surge_asked, num yaw_asked, num battery, answer_t *answer)
{
    const num available = battery < NUM(BATTERY_FLOOR) ? NUM(BATTERY_FLOOR) : battery;
    const num yaw = clamp(yaw_asked, available), surge = clamp(surge_asked, available - magnitude(yaw));

    heading_pid.saturated = excess(yaw_asked, yaw);
    speed_pid.saturated = excess(surge_asked, surge);
    answer->left = surge + yaw;
    answer->right = surge - yaw;
    answer->left_duty = num_div(answer->left, available);
    answer->right_duty = num_div(answer->right, available);
}

void control_begin(void)
{
    speed_pid.integral = heading_pid.integral = NUM(0);
    speed_pid.saturated = heading_pid.saturated = 0;
    last_phase = 0;
}

void control_law(const input_t *input, answer_t *answer)
{
    const num speed = look(input);
    const num heading = wrapped((input->phase == PHASE_BRAKE ? hold_heading : bearing) - input->heading);
    const num surge =
        pid(&speed_gains, &speed_pid, speed - input->speed, input->accel, num_mul(NUM(FEEDFORWARD), speed));
    const num yaw = pid(&heading_gains, &heading_pid, heading, input->yaw_rate, NUM(0));

    mix(surge, yaw, input->battery, answer);
}
