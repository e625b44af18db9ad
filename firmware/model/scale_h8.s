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
	bclr	#0,r4h
	jmp	@_fix_h8_scaled
