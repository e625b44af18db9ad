/* ours.c: the same law by the firmware's own functions. The line of sight is a part of firmware/autopilot/los.c that no header offers, so
 * that file is included. Its los_step() gets a declaration as static, and nobody calls it: the compiler leaves it out, and the rules with
 * it. */
#include "autopilot/los.h"
static __attribute__((unused)) void los_step_left_out(const los_config_t *, const route_t *, los_state_t *,
                                                      const signals_estimate_t *, signals_demand_t *);
#define los_step los_step_left_out
#include "autopilot/los.c"

#include "app/params_gen.h"
#include "constants.inc"
#include "control/pid.h"
#include "law.h"
#include "mixer/mixer.h"

static const route_waypoint_t waypoints[] = {WAYPOINTS_MM};
static const route_t route = {waypoints, sizeof waypoints / sizeof *waypoints};

static step_config_t config;
static los_state_t los;
static pid_state_t speed_pid, heading_pid;
static mixer_state_t mixer;

/* Eq. 22. */
static void guide(const native_t *input, const signals_estimate_t *estimate, signals_demand_t *demand)
{
    const bool brakes = input->phase == LOS_BRAKE;

    if (brakes && los.phase != LOS_BRAKE)
        los.hold_heading_bam16 = estimate->heading_bam16;
    los.phase = input->phase;
    los.waypoint = input->waypoint;
    look(&route, &los, estimate);
    sight(&los);
    if (brakes || compare_distance(&los, (uint16_t)(config.mode.los.bearing_hold_mm + 1U)) >= 0)
        los.bearing_bam16 = los.sight_bam16;
    demand->speed_mm_s_q4 =
        los.phase == LOS_DRIVE ? (int16_t)approach_speed_mm_s_q4(&config.mode.los, &los) : (int16_t)0;
    demand->heading_bam16 = brakes ? los.hold_heading_bam16 : los.bearing_bam16;
}

/* As step_run() of firmware/app/step.c. */
static void control(const signals_estimate_t *estimate, const signals_demand_t *demand, signals_effort_t *effort)
{
    pid_input_t input;
    pid_output_t output;

    input.period_ms = STEP_MS;
    input.error = fix_sub16(demand->speed_mm_s_q4, estimate->speed_mm_s_q4);
    input.rate = estimate->accel_mm_s2;
    input.feedforward_mv = fix_mul16_q10(config.feedforward_mv_q10, demand->speed_mm_s_q4);
    input.saturated = mixer.drive.surge_saturated;
    pid_step(&config.speed_pid, &speed_pid, &input, &output);
    effort->surge_mv = output.output_mv;

    input.error = fix_angle_diff_bam16(demand->heading_bam16, estimate->heading_bam16);
    input.rate = estimate->yaw_rate_mrad_s;
    input.feedforward_mv = 0;
    input.saturated = mixer.drive.yaw_saturated;
    pid_step(&config.heading_pid, &heading_pid, &input, &output);
    effort->yaw_mv = output.output_mv;
}

void control_begin(void)
{
    bytes_copy_flash(&config, &PARAMS_COUPLED.step, sizeof config);
}

void control_law(const input_t *input, answer_t *answer)
{
    signals_estimate_t estimate;
    signals_demand_t demand;
    signals_effort_t effort;
    signals_drive_t drive;

    estimate.x_um = input->x_um;
    estimate.y_um = input->y_um;
    estimate.heading_bam16 = input->heading_bam16;
    estimate.speed_mm_s_q4 = input->speed_mm_s_q4;
    estimate.accel_mm_s2 = input->accel_mm_s2;
    estimate.yaw_rate_mrad_s = input->yaw_rate_mrad_s;
    estimate.period_ms = STEP_MS;
    mixer.battery_mv = input->battery_mv;
    guide(input, &estimate, &demand);
    control(&estimate, &demand, &effort);
    mixer_step(&config.mixer, &mixer, &effort, &estimate, &drive);
    answer->left = drive.left_mv;
    answer->right = drive.right_mv;
    answer->left_duty = drive.left_q15;
    answer->right_duty = drive.right_q15;
}
