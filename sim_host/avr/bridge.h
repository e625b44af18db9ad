/* bridge.h: an H-bridge like the TB6612FNG, and the number of cycles in each of its states.
 *
 * IN1 and IN2 differ: a high PWM drives the motor, a low PWM shorts it. Both high: it is shorted. Both low: it coasts.
 */
#ifndef BRICKPILOT_SIM_AVR_BRIDGE_H
#define BRICKPILOT_SIM_AVR_BRIDGE_H

#include <stdbool.h>
#include <stdint.h>

typedef enum { BRIDGE_COAST, BRIDGE_SHORT, BRIDGE_FORWARD, BRIDGE_BACKWARD, BRIDGE_STATES } bridge_state_t;

typedef struct {
    bridge_state_t state;
    uint64_t since;                 /* cycle up to which `cycles` are counted */
    uint64_t cycles[BRIDGE_STATES]; /* cycles in each state since the last bridge_clear() */
} bridge_t;

bridge_state_t bridge_state(bool in1, bool in2, bool pwm);

/* From cycle `now` on, the bridge is in this state. If `now` is before the last call's `now`, the last one is used. */
void bridge_set(bridge_t *bridge, bridge_state_t state, uint64_t now);

/* Counts the cycles of the present state up to cycle `now`. */
void bridge_count(bridge_t *bridge, uint64_t now);

void bridge_clear(bridge_t *bridge);

/* Returns the mean duty over the counted cycles, -1..1; a shorted motor has duty 0. NaN: the motor coasted for at least
 * half of the time, or nothing was counted. A shorter coasting time is left out of the mean. */
double bridge_duty(const bridge_t *bridge);

#endif
