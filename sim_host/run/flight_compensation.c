#include "run/flight_compensation.h"

#include <stddef.h>

#include "app/compensation.h"

enum { MOST_MV = 20000 };

static bool is_size(short value_mv)
{
    return value_mv >= 0 && value_mv <= MOST_MV;
}

static bool is_voltage(short value_mv)
{
    return value_mv >= -MOST_MV && value_mv <= MOST_MV;
}

bool flight_can_compensate(const bp_compensation *given)
{
    return given == NULL ||
           (is_size(given->left_friction_mv) && is_size(given->right_friction_mv) && is_size(given->deadband_mv) &&
            is_size(given->reserve_mv) && is_voltage(given->left_offset_mv) && is_voltage(given->right_offset_mv) &&
            given->half_track_m_q14 >= 0 && (given->battery_sags == 0 || given->battery_sags == 1));
}

void flight_compensate(const bp_compensation *given, loop_config_t *config)
{
    const compensation_t found = {.drive = {.left = {.gain_q15 = given->left_gain_q15,
                                                     .emf_mv_q15 = given->left_emf_mv_q15,
                                                     .friction_mv = given->left_friction_mv,
                                                     .offset_mv = given->left_offset_mv},
                                            .right = {.gain_q15 = given->right_gain_q15,
                                                      .emf_mv_q15 = given->right_emf_mv_q15,
                                                      .friction_mv = given->right_friction_mv,
                                                      .offset_mv = given->right_offset_mv},
                                            .deadband_mv = given->deadband_mv,
                                            .half_track_m_q14 = given->half_track_m_q14,
                                            .reserve_mv = given->reserve_mv},
                                  .battery_sags = given->battery_sags != 0,
                                  .gyro_bias_mrad_s = given->gyro_bias_mrad_s,
                                  .gyro_scale_q15 = given->gyro_scale_q15,
                                  .travel_scale_q15 = given->travel_scale_q15,
                                  .count_mismatch_q15 = given->count_mismatch_q15};
    compensation_apply(&found, config);
}
