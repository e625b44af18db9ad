#include "plant/contact.h"

#include "plant/contact_load.h"
#include "plant/contact_no_slip.h"
#include "plant/contact_paper.h"

const contact_t *contact_of(const vehicle_t *vehicle)
{
    if (vehicle->vehicle == BP_MOTOR)
        return &contact_load;
    if (vehicle->profile == BP_PAPER)
        return &contact_paper;
    const bool slips = vehicle->build.along.creep > 0 || vehicle->build.across.creep > 0; /* a skid steer always does */
    return slips ? &contact_slip : &contact_no_slip;
}
