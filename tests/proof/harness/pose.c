#include "contracts.h"
#include "estimator/pose.c"

void pose_safe(void)
{
    pose_state_t state;
    signals_sensors_t sensors;
    signals_estimate_t estimate;

    ASSUME(sensors_hold(&sensors) && pose_holds(&state) && estimate_holds(&estimate));
    pose_step(&state, &sensors, &estimate);
    ASSERT(pose_holds(&state));
    ASSERT(estimate_holds(&estimate));
    END();
}
