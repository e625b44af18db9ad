; scale_h8.s: the products of scale.h in the RCX's own instructions: see core/h8.inc.
	.include "core/h8.inc"
	.text

; Where nothing is shifted away after it, the product of the low word decides on the rounding.
	.macro	ROUND_UNSHIFTED
	mov.b	r4l,r4l
	bne	.Lshifted_later
	add.b	r0l,r0l
	addx	#0,r3l
	addx	#0,r3h
.Lshifted_later:
	.endm

; \value * 2 |mantissa|: what both begin with. r6 the mantissa, r4h its sign.
	.macro	LOAD	sign
	SAVE
	mov.w	@r0,r6
	mov.b	@(2,r0),r4l
	mov.b	r6h,r4h
	xor	\sign,r4h
	mov.w	r6,r6
	bpl	.Lmantissa\@
	not	r6h
	not	r6l
	adds	#1,r6
.Lmantissa\@:
	add.w	r6,r6
	.endm

; int32_t scale_apply(const scale_t *scale, int32_t value)
	.align 1
	.global _scale_apply
_scale_apply:
	LOAD	r1h
	mov.w	r1,r5
	bpl	.Lvalue
	NEGATE	r5h,r5l,r2h,r2l
.Lvalue:
	PRODUCT_Q16	ROUND_UNSHIFTED
	mov.b	r4l,r4l
	beq	.Lunshifted
	jsr	@_fix_h8_round_shift
.Lunshifted:
	SIGNED_RESULT

; int32_t scale_apply16(const scale_t *scale, int16_t value)
	.align 1
	.global _scale_apply16
_scale_apply16:
	LOAD	r1h
	mov.w	r1,r1
	bpl	.Lvalue16
	not	r1h
	not	r1l
	adds	#1,r1
.Lvalue16:
	mov.w	r6,r0
	PRODUCT
	mov.b	r0l,r2h
	add.b	#1,r4l
	jsr	@_fix_h8_round_shift
	SIGNED_RESULT
