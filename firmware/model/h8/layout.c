/* layout.c: does not compile for the RCX if an offset in core/h8/layout.h is wrong. It makes no code. */
#include "core/h8/layout.h"

#include <stddef.h>

#include "core/curve.h"
#include "core/fix.h"
#include "model/body.h"

/* Declares an array of negative size if the offset is wrong: the compiler's message names the offset to correct. */
#define CHECK(type, field, offset)                                                                                     \
    extern char correct_in_core_h8_layout_h_##offset[offsetof(type, field) == (offset) ? 1 : -1];

#ifdef __H8300__ /* other compilers use other layouts */
LAYOUT_OF_CORE(CHECK)
LAYOUT_OF_MOTOR(CHECK)
LAYOUT_OF_BODY(CHECK)
#ifndef BODY_VELOCITY_ONLY
LAYOUT_OF_LARGER_BODY(CHECK)
#endif
#endif
