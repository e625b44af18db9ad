#include "plant/contact.h"

const contact_t *contact_of(int vehicle, int profile)
{
    if (vehicle == BP_MOTOR)
        return &contact_load;
    return profile == BP_PAPER ? &contact_paper : &contact_no_slip;
}
