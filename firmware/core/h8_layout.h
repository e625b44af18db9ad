/* h8_layout.h: for headers *_h8.h that tell .S files where the RCX's compiler puts a struct's fields. A wrong one does not compile. */
#ifndef BRICKPILOT_CORE_H8_LAYOUT_H
#define BRICKPILOT_CORE_H8_LAYOUT_H

#define H8_LAYOUT(type, field, at) extern char h8_layout[(uint16_t) & ((const type *)0)->field == (at) ? 1 : -1]

#endif
