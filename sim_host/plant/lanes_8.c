/* Eight robots in registers of 512 bits, where an x86 processor has them. On Windows gcc does not align the stack for
 * them. */
#if defined(__x86_64__) && !defined(_WIN32)
#ifdef __clang__
#pragma clang attribute push(__attribute__((target("avx512f,avx512dq"))), apply_to = function)
#else
#pragma GCC target("avx512f,avx512dq")
#endif
#define LANES 8
#define LANES_KERNEL lanes_kernel_8
#define LANES_RUN_HERE (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq"))
#include "plant/lanes_laws.h"
#ifdef __clang__
#pragma clang attribute pop
#endif
#endif
