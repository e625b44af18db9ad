#include "contracts.h"
#include "core/bytes.c"

enum { MOST = 24 }; /* bytes; the loops take them one by one, whatever the size */

void bytes_safe(void)
{
    uint8_t to[MOST], from[MOST], before[MOST];
    uint16_t size;
    uint8_t at;

    for (uint8_t i = 0; i < MOST; i++)
        before[i] = to[i];
    ASSUME(size >= 1 && size <= MOST && at < MOST);
    bytes_copy(to, from, size);
    ASSERT(to[at] == (at < size ? from[at] : before[at]));
    bytes_clear(to, size);
    ASSERT(to[at] == (at < size ? 0 : before[at]));
    END();
}
