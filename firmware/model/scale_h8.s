; scale_h8.s: the products of scale.h in the RCX's own instructions: see core/h8.inc.
	.include "core/h8.inc"
	.text

; int32_t scale_apply16(const scale_t *scale, int16_t value): of 65536 times the value, and 65536 times smaller.
	.align 1
	.global _scale_apply16
_scale_apply16:
	SAVE
	sub.w	r2,r2
	mov.b	#1,r4l
	bra	.Lapply

; int32_t scale_apply(const scale_t *scale, int32_t value): value (r5:r2) * 2 |mantissa| (r6), r4h the sign.
	.align 1
	.global _scale_apply
_scale_apply:
	SAVE
	sub.b	r4l,r4l
.Lapply:
	mov.w	@r0,r6
	mov.b	@(2,r0),r4h
	add.b	r4h,r4l
	mov.b	r6h,r4h
	xor	r1h,r4h
	mov.w	r6,r6
	bpl	.Lmantissa
	not	r6h
	not	r6l
	adds	#1,r6
.Lmantissa:
	add.w	r6,r6
	mov.w	r1,r5
	bpl	.Lvalue
	NEGATE	r5h,r5l,r2h,r2l
.Lvalue:
	jsr	@_fix_h8_product_q16
	mov.b	r4l,r4l
	beq	.Lunshifted
	jsr	@_fix_h8_round_shift
	SIGNED_RESULT
.Lunshifted:			; what is cut off decides on the rounding
	add.b	r6l,r6l
	addx	#0,r2l
	addx	#0,r2h
	addx	#0,r3l
	addx	#0,r3h
	SIGNED_RESULT

; int32_t motor_row(const motor_row_t *row, const motor_state_t *state, int16_t voltage_mv): three scales of 4 bytes, two values of 4.
	.align 1
	.global _motor_row
_motor_row:
	mov.w	r4,@-r7
	mov.w	r5,@-r7
	mov.w	r0,r4
	mov.w	r1,r5
	add.b	#8,r0l
	addx	#0,r0h
	mov.w	r2,r1
	jsr	@_scale_apply16
	bsr	.Lterm
	bsr	.Lterm
	mov.w	@r7+,r5
	mov.w	@r7+,r4
	rts
.Lterm:
	mov.w	r1,@-r7
	mov.w	r0,@-r7
	mov.w	r4,r0
	mov.w	@r5+,r1
	mov.w	@r5+,r2
	jsr	@_scale_apply
	adds	#2,r4
	adds	#2,r4
	mov.w	@r7+,r2
	mov.w	@r7+,r3
	add.w	r3,r1
	addx	r2l,r0l
	addx	r2h,r0h
	rts
