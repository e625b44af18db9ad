/* Two robots in registers of 128 bits, which all 64-bit processors of x86 and ARM have. Elsewhere the compiler splits
 * them, and that is right, too. */
#define LANES 2
#define LANES_KERNEL lanes_kernel_2
#define LANES_RUN_HERE true
#include "plant/lanes_laws.h"
