; scale_h8.S: the products of scale.h in the RCX's own instructions: see core/h8.inc. Nothing but `paper` multiplies 16 bits.
	.include "core/h8.inc"
	.text

#ifndef BODY_WITHOUT_PAPER
; int32_t scale_apply16(const scale_t *scale, int16_t value): of 65536 times the value, and 65536 times smaller.
	.align 1
	.global _scale_apply16
_scale_apply16:
	SAVE
	sub.w	r2,r2
	mov.w	#0x100,r4
	bra	.Lapply
#endif

; scale_apply of a scale r0l bytes from r4
	.align 1
	.global _scale_h8_at
_scale_h8_at:
	sub.b	r0h,r0h
	add.w	r4,r0

; int32_t scale_apply(const scale_t *scale, int32_t value): value (r5:r2) * 2 |mantissa| (r6), r4h the shift, r4l the sign.
	.global _scale_apply
_scale_apply:
	SAVE
	sub.w	r4,r4
.Lapply:
	mov.w	@r0+,r6
	mov.b	@r0,r0l
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
	jsr	@_fix_h8_scaled
	mov.w	@r7+,r6
	mov.w	@r7+,r5
	mov.w	@r7+,r4
	jmp	@_fix_h8_round
