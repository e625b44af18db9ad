; scale.S: the products of scale.h in the RCX's own instructions: see core/h8/macros.inc. Only `paper` multiplies 16 bits.
#include "core/h8/layout.h"
	.include "core/h8/macros.inc"
	.text

#if SCALE_MANTISSA != 0 || SCALE_SHIFT != 2
#error "a scale is read as a word and the byte behind it"
#endif

#ifndef BODY_WITHOUT_PAPER
; int32_t scale_apply16(const scale_t *scale, int16_t value): 65536 times the value, with a shift that is 16 larger
	.align 1
	.global _scale_apply16
_scale_apply16:
	SAVE
	sub.w	r2,r2
	mov.w	#0x100,r4
	bra	.Lapply
#endif

; int32_t scale_apply(const scale_t *scale, int32_t value)
	.align 1
	.global _scale_apply
_scale_apply:
	SAVE
	sub.w	r4,r4

; Inner routine, the end of a function that began with SAVE: returns r1:r2 by the scale at r0, r4h added to its shift. The
; product is of the value (r5:r2) and 2 |mantissa| (r6); r4h is the shift, r4l the sign.
.Lapply:
	mov.w	@r0+,r6		; SCALE_MANTISSA
	mov.b	@r0,r0l		; SCALE_SHIFT
	add.b	r0l,r4h
	mov.b	r6h,r4l
	xor	r1h,r4l
	mov.w	r6,r6
	bpl	.Lmantissa
	not	r6h
	not	r6l
	adds	#1,r6
.Lmantissa:
	add.w	r6,r6
	mov.w	r1,r5
	bpl	.Lvalue
	mov.w	r2,r3
	sub.w	r5,r5
	sub.w	r2,r2
	sub.w	r3,r2
	subx	r1l,r5l
	subx	r1h,r5h
.Lvalue:
	jsr	@_fix_inner_multiply
	mov.w	@r7+,r6
	mov.w	@r7+,r5
	mov.w	@r7+,r4
	jmp	@_fix_inner_round
