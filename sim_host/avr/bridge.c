#include "avr/bridge.h"

#include <math.h>

bridge_state_t bridge_state(bool in1, bool in2, bool pwm)
{
    if (in1 == in2)
        return in1 ? BRIDGE_SHORT : BRIDGE_COAST;
    if (!pwm)
        return BRIDGE_SHORT;
    return in1 ? BRIDGE_FORWARD : BRIDGE_BACKWARD;
}

void bridge_count(bridge_t *bridge, uint64_t now)
{
    if (now <= bridge->since)
        return;
    bridge->cycles[bridge->state] += now - bridge->since;
    bridge->since = now;
}

void bridge_set(bridge_t *bridge, bridge_state_t state, uint64_t now)
{
    bridge_count(bridge, now);
    bridge->state = state;
}

void bridge_clear(bridge_t *bridge)
{
    for (int state = 0; state < BRIDGE_STATES; state++)
        bridge->cycles[state] = 0;
}

double bridge_duty(const bridge_t *bridge)
{
    const double forward = (double)bridge->cycles[BRIDGE_FORWARD], backward = (double)bridge->cycles[BRIDGE_BACKWARD];
    const double connected = forward + backward + (double)bridge->cycles[BRIDGE_SHORT];

    if (connected <= (double)bridge->cycles[BRIDGE_COAST])
        return NAN;
    return (forward - backward) / connected;
}
