/* Four robots in registers of 256 bits, where an x86 processor has them. On Windows gcc does not align the stack for
 * them. */
#if defined(__x86_64__) && !defined(_WIN32)
#ifdef __clang__
#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)
#else
#pragma GCC target("avx2")
#endif
#define LANES 4
#define LANES_KERNEL lanes_kernel_4
#define LANES_RUN_HERE (__builtin_cpu_supports("avx2"))
#include "plant/lanes_laws.h"
#ifdef __clang__
#pragma clang attribute pop
#endif
#endif
