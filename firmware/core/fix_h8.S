; fix_h8.S: the arithmetic of fix.h that a step spends most of its time in, in the RCX's own instructions: see h8.inc.
	.include "core/h8.inc"
	.text

; uint32_t fix_mul_u16(uint16_t a, uint16_t b)
	.align 1
	.global _fix_mul_u16
_fix_mul_u16:
	mov.b	r0l,r2l
	mulxu.b	r1l,r2		; low * low
	mov.b	r0h,r3l
	mulxu.b	r1l,r3		; high * low
	mov.b	r0h,r1l
	mulxu.b	r1h,r0		; low * high
	mulxu.b	r1h,r1		; high * high
	add.b	r2h,r3l
	addx	#0,r3h
	add.w	r3,r0		; the middle
	addx	#0,r1h
	add.b	r0h,r1l
	addx	#0,r1h
	mov.b	r0l,r2h
	mov.w	r1,r0
	mov.w	r2,r1
	rts

; int32_t fix_mul(int16_t a, int16_t b): the product of both without sign, less 65536 times the other for each that is negative.
	.align 1
	.global _fix_mul
_fix_mul:
	mov.w	r0,@-r7
	mov.w	r1,@-r7
	jsr	@_fix_mul_u16
	mov.w	@r7+,r2
	bpl	.Lsecond_positive
	mov.w	@r7,r3
	sub.w	r3,r0
.Lsecond_positive:
	mov.w	@r7+,r3
	bpl	.Lfirst_positive
	sub.w	r2,r0
.Lfirst_positive:
	rts

; uint32_t fix_mul_u32_q16(uint32_t a, uint16_t b)
	.align 1
	.global _fix_mul_u32_q16
_fix_mul_u32_q16:
	SAVE
	sub.b	r4l,r4l
	mov.w	r2,r6
	mov.w	r1,r2
	mov.w	r0,r5
	bra	.Lmultiply

.Lall:				; by 2^15: all of it, but at most 2^31 - 1
	mov.w	r5,r1
	bpl	.Lfits
	subs	#1,r1
	subs	#1,r2
.Lfits:
	mov.w	r4,r0
	bra	.Lcut_and_leave

; int32_t fix_share_q15(int32_t value, int16_t factor_q15)
	.align 1
	.global _fix_share_q15
_fix_share_q15:
	mov.w	r2,r2
	beq	.Lnothing
	mov.w	r0,r0
	bne	.Lsomething
	mov.w	r1,r1
	bne	.Lsomething
.Lnothing:
	sub.w	r0,r0
	sub.w	r1,r1
	rts
.Lsomething:
	SAVE
	mov.b	r0h,r4l
	xor	r2h,r4l
	mov.w	r2,r6
	bpl	.Lfactor
	not	r6h
	not	r6l
	adds	#1,r6
.Lfactor:
	mov.w	r1,r2
	mov.w	r0,r5
	bpl	.Lvalue
	sub.w	r5,r5
	sub.w	r2,r2
	sub.w	r1,r2
	subx	r0l,r5l
	subx	r0h,r5h
.Lvalue:
	add.w	r6,r6
	bcs	.Lall
.Lmultiply:
	mov.b	#0x80,r4h
	bsr	_fix_h8_scaled
.Lcut_and_leave:
	mov.w	@r7+,r6
	mov.w	@r7+,r5
	mov.w	@r7+,r4

; r1:r2 (without sign) to r0:r1, negated where bit 7 of r0l is set. .Lround: one more where the carry is set.
.Lcut:
	andc	#0xfe,ccr
	.global _fix_h8_round
_fix_h8_round:
	mov.b	r0l,r0l
	bmi	.Lnegative
	mov.w	r1,r0
	mov.w	r2,r1
	addx	#0,r1l
	addx	#0,r1h
	addx	#0,r0l
	addx	#0,r0h
	rts
.Lnegative:
	mov.w	r1,r3
	mov.w	#0,r0		; not by sub.w: the carry is still to be counted
	mov.w	r0,r1
	subx	r2l,r1l
	subx	r2h,r1h
	subx	r3l,r0l
	subx	r3h,r0h
	rts

; int32_t fix_fraction(int32_t value, uint8_t bits)
	.align 1
	.global _fix_fraction
_fix_fraction:
	bsr	.Lmagnitude_shift
	bra	.Lcut

; int32_t fix_round_shift(int32_t value, uint8_t bits)
	.align 1
	.global _fix_round_shift
_fix_round_shift:
	bsr	.Lmagnitude_shift
	bra	_fix_h8_round

.Lmagnitude_shift:		; r0:r1 / 2^r2l to r1:r2 and the carry, r0l the sign
	mov.b	r2l,r3l
	mov.w	r1,r2
	mov.w	r0,r1
	bpl	.Lnot_negative
	mov.w	r2,r1
	sub.w	r2,r2
	sub.w	r1,r2
	mov.w	#0,r1
	subx	r0l,r1l
	subx	r0h,r1h
.Lnot_negative:
	mov.b	r0h,r0l
	mov.b	r3l,r0h
	bra	.Lshift

; r5:r2 * r6 / 2^16, all without sign, to r1:r2; where bit 7 of r4h is not set, divided by 2^r4h (0 to 31) too, and the carry is the last
; bit that fell off. r4 to r0. Uses all registers but r4.
	.align 1
	.global _fix_h8_scaled
_fix_h8_scaled:
	sub.w	r3,r3
	mov.w	r2,r2
	beq	.Lonly_high
	mov.b	r2l,r0l
	mulxu.b	r6l,r0		; low * low
	mov.b	r2h,r1l
	mulxu.b	r6l,r1		; high * low
	mov.b	r2l,r3l
	mulxu.b	r6h,r3		; low * high
	mov.b	r2h,r2l
	mulxu.b	r6h,r2		; high * high
	add.b	r0h,r1l
	addx	#0,r1h
	add.w	r1,r3		; the middle: r3l the highest byte of what is cut off
	addx	#0,r2h
	add.b	r3h,r2l
	addx	#0,r2h
.Lonly_high:
	mov.w	r5,r1
	beq	.Lscaled
	mov.b	r5l,r0l
	mulxu.b	r6l,r0
	mov.b	r5h,r1l
	mulxu.b	r6h,r1
	add.w	r0,r2
	addx	#0,r1l
	addx	#0,r1h
	mov.b	r5h,r0l
	mulxu.b	r6l,r0
	mulxu.b	r6h,r5
	add.w	r5,r0
	addx	#0,r1h
	add.b	r0l,r2h
	addx	r0h,r1l
	addx	#0,r1h
.Lscaled:
	mov.w	r4,r0
	bmi	.Lshifted

; r1:r2 (without sign) / 2^r0h to r1:r2, cut; the carry: the last bit that fell off; where r0h is 0, bit 7 of r3l. r0h 0 to 31. Uses r0h,
; r3l. Bytes, then bits: right, or left in a byte more.
.Lshift:
	add.b	#-8,r0h
	bcc	.Lbits
	mov.b	r2l,r3l
	mov.b	r2h,r2l
	mov.b	r1l,r2h
	mov.b	r1h,r1l
	sub.b	r1h,r1h
	bra	.Lshift
.Lbits:
	cmp.b	#-3,r0h
	bcc	.Lleft
	add.b	#8,r0h
	bne	.Lright
	add.b	r3l,r3l
.Lshifted:
	rts
.Lright:
	shlr	r1h
	rotxr	r1l
	rotxr	r2h
	rotxr	r2l
	dec	r0h
	bne	.Lright
	rts
.Lleft:
	sub.b	r3l,r3l
.Lleft_again:
	add.w	r2,r2
	rotxl	r1l
	rotxl	r1h
	rotxl	r3l
	inc	r0h
	bne	.Lleft_again
	add.b	r2l,r2l
	mov.b	r2h,r2l
	mov.b	r1l,r2h
	mov.b	r1h,r1l
	mov.b	r3l,r1h
	rts

; int32_t fix_dot(const fix_pair_t *of, const fix_pair_t *with)
	.align 1
	.global _fix_dot
_fix_dot:
.Ldot:
	mov.w	r4,@-r7
	mov.w	r5,@-r7
	mov.w	r0,r4
	mov.w	r1,r5
	mov.w	@r4+,r0
	mov.w	@r5+,r1
	jsr	@_fix_mul
	PUSH32
	mov.w	@r4,r0
	mov.w	@r5,r1
	jsr	@_fix_mul
	mov.w	@r7+,r2
	mov.w	@r7+,r3
	ADD32
	mov.w	@r7+,r5
	mov.w	@r7+,r4
	rts

; int16_t fix_along(const fix_pair_t *of, const fix_pair_t *direction_q15): twice the magnitude and a half, its high word
	.align 1
	.global _fix_along
_fix_along:
	bsr	.Ldot
	mov.w	r0,@-r7
	jsr	@_fix_abs_u32
	mov.w	#0x4000,r2
	add.w	r2,r1
	addx	#0,r0l
	addx	#0,r0h
	add.w	r1,r1
	rotxl	r0l
	rotxl	r0h
	bcs	.Lmost_along
	mov.w	r0,r0
	bpl	.Lalong
.Lmost_along:
	mov.w	#0x7fff,r0
.Lalong:
	mov.w	@r7+,r2
	bmi	.Lbackward
	rts
.Lbackward:
	jmp	@.Lnegate16

; int16_t fix_against_square(const int32_t *value, uint16_t root): value less square; both words of that in one
	.align 1
	.global _fix_against_square
_fix_against_square:
	mov.w	r0,@-r7
	mov.w	r1,r0
	jsr	@_fix_mul_u16
	mov.w	@r7+,r3
	mov.w	@(2,r3),r2
	sub.w	r1,r2
	mov.w	@r3,r3
	subx	r0l,r3l
	subx	r0h,r3h
	mov.w	r3,r0
	or	r2h,r0l
	or	r2l,r0l
	rts

; int16_t fix_thousandth(int32_t value)
	.align 1
	.global _fix_thousandth
_fix_thousandth:
	SAVE
	mov.w	#0x0800,r4
	mov.b	r0h,r4l
	mov.w	#16777,r6
	mov.w	r1,r2
	mov.w	r0,r5
	bpl	.Lthousands
	NEGATE	r5h,r5l,r2h,r2l
.Lthousands:
	jsr	@_fix_h8_scaled
	mov.w	@r7+,r6
	mov.w	@r7+,r5
	mov.w	@r7+,r4
	jsr	@_fix_h8_round
	jmp	@_fix_sat16

; int32_t fix_add_to(int32_t value, int32_t *sum)
	.align 1
	.global _fix_add_to
_fix_add_to:
	mov.w	r2,@-r7
	mov.w	@(2,r2),r3
	mov.w	@r2,r2
	bsr	.Ladd
	mov.w	@r7+,r2
	mov.w	r0,@r2
	mov.w	r1,@(2,r2)
	rts

; By signs: the simulator sets V wrong after ADDX and SUBX.
.Ladd:
	add.w	r3,r1
	mov.b	r0h,r3h
	addx	r2l,r0l
	addx	r2h,r0h
	xor	r0h,r2h
	xor	r0h,r3h
	and	r2h,r3h
	bmi	.Lbeyond	; the sum's sign is neither's
	mov.b	r0h,r0h
	bmi	.Lleast
	rts

; int32_t fix_less(int32_t value, const int32_t *other)
	.align 1
	.global _fix_less
_fix_less:
	mov.w	@(2,r2),r3
	mov.w	@r2,r2
	sub.w	r3,r1
	mov.b	r0h,r3h
	subx	r2l,r0l
	subx	r2h,r0h
	xor	r3h,r2h
	xor	r0h,r3h
	and	r2h,r3h
	bmi	.Lbeyond
	mov.b	r0h,r0h
	bmi	.Lleast
	rts
.Lbeyond:			; the sign is the wrong one
	mov.w	r0,r0
	bmi	.Lmost
	mov.w	#0x8000,r0
	mov.w	#1,r1
	rts
.Lmost:
	mov.w	#0x7fff,r0
	mov.w	#0xffff,r1
	rts
.Lleast:			; -2^31 becomes -(2^31 - 1)
	mov.w	#0x8000,r2
	cmp.w	r2,r0
	bne	.Lsum
	mov.w	r1,r1
	bne	.Lsum
	adds	#1,r1
.Lsum:
	rts

; int32_t fix_clamp32(int32_t value, int32_t limit): limit is on the stack
	.align 1
	.global _fix_clamp32
_fix_clamp32:
	mov.w	@(2,r7),r2
	mov.w	@(4,r7),r3
	mov.w	r0,r0
	bmi	.Lbelow_zero
	cmp.w	r2,r0
	bcs	.Lwithin
	bne	.Lclamped
	cmp.w	r3,r1
	bls	.Lwithin
	bra	.Lclamped
.Lbelow_zero:
	NEGATE	r2h,r2l,r3h,r3l
	cmp.w	r2,r0
	bgt	.Lwithin
	blt	.Lclamped
	cmp.w	r3,r1
	bcc	.Lwithin
.Lclamped:
	mov.w	r2,r0
	mov.w	r3,r1
.Lwithin:
	rts

; int32_t fix_clamp_q16(int32_t value, int16_t limit)
	.align 1
	.global _fix_clamp_q16
_fix_clamp_q16:
	mov.w	r0,r0
	bmi	.Lbelow_zero_q16
	cmp.w	r2,r0
	blt	.Lwithin_q16
	bra	.Lclamped_q16
.Lbelow_zero_q16:
	not	r2h
	not	r2l
	adds	#1,r2
	cmp.w	r2,r0
	bge	.Lwithin_q16
.Lclamped_q16:
	mov.w	r2,r0
	sub.w	r1,r1
.Lwithin_q16:
	rts

; int32_t fix_q8(int16_t value)
	.align 1
	.global _fix_q8
_fix_q8:
	sub.b	r1l,r1l
	mov.b	r0l,r1h
	mov.b	r0h,r0l
	bld	#7,r0h
	subx	r0h,r0h
	rts

; int32_t fix_times(int32_t value, uint8_t factor): by bytes, the lowest first.
	.align 1
	.global _fix_times
_fix_times:
	mov.b	r1l,r3l
	mulxu.b	r2l,r3
	mov.b	r1h,r1l
	mulxu.b	r2l,r1
	add.b	r3h,r1l
	addx	#0,r1h
	mov.b	r0h,r2h
	mulxu.b	r2l,r0
	add.b	r1h,r0l
	addx	#0,r0h
	mov.b	r1l,r1h
	mov.b	r3l,r1l
	mov.b	r2h,r3l
	mulxu.b	r2l,r3
	add.b	r3l,r0h
	rts

; int16_t fix_inverse_q15(uint8_t value)
	.align 1
	.global _fix_inverse_q15
_fix_inverse_q15:
	mov.b	r0l,r1l
	shlr	r0l
	sub.b	r2h,r2h
	mov.b	#0x80,r2l
	divxu.b	r1l,r2
	mov.b	r2h,r0h
	divxu.b	r1l,r0
	mov.b	r2l,r0h
	bpl	.Linverse
	subs	#1,r0
.Linverse:
	rts

; uint8_t fix_bits(uint16_t count, uint8_t most)
	.align 1
	.global _fix_bits
_fix_bits:
	sub.b	r2l,r2l
.Lcount_bits:
	mov.w	r0,r0
	beq	.Lcounted
	cmp.b	r1l,r2l
	bcc	.Lcounted
	inc	r2l
	shlr	r0h
	rotxr	r0l
	bra	.Lcount_bits
.Lcounted:
	mov.b	r2l,r0l
	rts

; int16_t fix_gain16_q10(int16_t gain_q10, int16_t value); r3:r1 is what it would be without saturation
	.align 1
	.global _fix_gain16_q10
_fix_gain16_q10:
	jsr	@_fix_gain_q10
	mov.w	r0,r3
	bra	.Lsat16

; int16_t fix_round16(int32_t value, uint8_t bits): a byte, then up to 7 bits; r3h the sign.
	.align 1
	.global _fix_round16
_fix_round16:
	mov.b	r0h,r3h
	bpl	.Lmagnitude16
	NEGATE	r0h,r0l,r1h,r1l
.Lmagnitude16:
	add.b	#-8,r2l
	beq	.Lbyte16
.Lbit16:
	shlr	r0h
	rotxr	r0l
	rotxr	r1h
	dec	r2l
	bne	.Lbit16
	bra	.Lround16
.Lbyte16:
	add.b	r1l,r1l
.Lround16:
	mov.b	r1h,r1l
	mov.b	r0l,r1h
	addx	#0,r1l		; the last bit that fell off
	addx	#0,r1h
	addx	#0,r0h
	mov.b	r0h,r0h
	bne	.Lmost16
	mov.w	r1,r0
	bpl	.Lwithin_most16
.Lmost16:
	mov.w	#0x7fff,r0
.Lwithin_most16:
	mov.b	r3h,r3h
	bmi	.Lnegate16
	rts

; int16_t fix_sat16(int32_t value), fix_add16(int16_t a, int16_t b), fix_sub16: at most 32767 in magnitude
	.align 1
	.global _fix_sat16
_fix_sat16:
.Lsat16:
	mov.w	r1,r2
	bmi	.Llow_negative16
	mov.w	r0,r0
	bne	.Lbeyond16
	mov.w	r1,r0
	rts
.Llow_negative16:
	mov.w	r0,r2
	adds	#1,r2
	mov.w	r2,r2
	bne	.Lbeyond16
	mov.w	r1,r0
.Lleast16:			; -32768 becomes -32767
	mov.w	#0x8000,r2
	cmp.w	r2,r0
	beq	.Lnegative16
	rts
.Lbeyond16:
	mov.w	r0,r0
	bmi	.Lnegative16
	mov.w	#0x7fff,r0
	rts
.Lnegative16:
	mov.w	#0x8001,r0
	rts
	.align 1
	.global _fix_add16
_fix_add16:
	add.w	r1,r0
	bvc	.Lleast16
	bra	.Lother_sign
	.align 1
	.global _fix_sub16
_fix_sub16:
	sub.w	r1,r0
	bvc	.Lleast16
.Lother_sign:			; the sign is the wrong one
	bpl	.Lnegative16
	mov.w	#0x7fff,r0
	rts

; int16_t fix_clamp16(int16_t value, int16_t limit)
	.align 1
	.global _fix_clamp16
_fix_clamp16:
	cmp.w	r1,r0
	bgt	.Lclamped16
	not	r1h
	not	r1l
	adds	#1,r1
	cmp.w	r1,r0
	bge	.Lwithin16
.Lclamped16:
	mov.w	r1,r0
.Lwithin16:
	rts

; uint16_t fix_count_u16(uint16_t count), fix_add_u16(uint16_t a, uint16_t b)
	.align 1
	.global _fix_count_u16
_fix_count_u16:
	mov.w	#1,r1
	.global _fix_add_u16
_fix_add_u16:
	add.w	r1,r0
	bcc	.Lfits_u16
	mov.w	#0xffff,r0
.Lfits_u16:
	rts

; uint16_t fix_round_bam16(uint32_t angle_bam32): 2^15 more, or 2^15 - 1 of a negative one, and its high word.
	.align 1
	.global _fix_round_bam16
_fix_round_bam16:
	mov.b	r0h,r2l
	add.b	r2l,r2l
	mov.w	#0x8000,r2
	subx	#0,r2l
	subx	#0,r2h
	add.w	r2,r1
	addx	#0,r0l
	addx	#0,r0h
	rts

; uint16_t fix_abs_u16(int16_t value)
	.align 1
	.global _fix_abs_u16
_fix_abs_u16:
	mov.w	r0,r0
	bpl	.Labsolute16
.Lnegate16:
	not	r0h
	not	r0l
	adds	#1,r0
.Labsolute16:
	rts

; uint32_t fix_abs_u32(int32_t value)
	.align 1
	.global _fix_abs_u32
_fix_abs_u32:
.Lmagnitude32:
	mov.w	r0,r0
	bpl	.Labsolute
	NEGATE	r0h,r0l,r1h,r1l
.Labsolute:
	rts

; int32_t fix_gain_q10(int16_t gain_q10, int16_t value): the product by magnitude, half of a unit more, a byte and two bits less.
	.align 1
	.global _fix_gain_q10
_fix_gain_q10:
	mov.w	r1,@-r7
	bpl	.Lgain_of_magnitude
	not	r1h
	not	r1l
	adds	#1,r1
.Lgain_of_magnitude:
	jsr	@_fix_mul_u16
	add.b	#2,r1h
	addx	#0,r0l
	addx	#0,r0h
	.rept	2
	shlr	r0h
	rotxr	r0l
	rotxr	r1h
	.endr
	mov.b	r1h,r1l
	mov.b	r0l,r1h
	mov.b	r0h,r0l
	sub.b	r0h,r0h
	bra	.Lby_sign

; int32_t fix_share_q16(int32_t value, uint16_t factor_q16)
	.align 1
	.global _fix_share_q16
_fix_share_q16:
	mov.w	r0,@-r7
	jsr	@_fix_abs_u32
	jsr	@_fix_mul_u32_q16
.Lby_sign:
	mov.w	@r7+,r2
	bpl	.Lpositive_share
	NEGATE	r0h,r0l,r1h,r1l
.Lpositive_share:
	rts

; int16_t fix_share16_q15(int16_t value, int16_t factor_q15)
	.align 1
	.global _fix_share16_q15
_fix_share16_q15:
	mov.w	r1,r2
	beq	.Lno_share
	mov.w	r0,r1
	mov.b	r0h,r0l
	add.b	r0l,r0l
	subx	r0l,r0l
	mov.b	r0l,r0h
	jsr	@_fix_share_q15
	jmp	@_fix_sat16
.Lno_share:
	sub.w	r0,r0
	rts

; int8_t fix_excess(int16_t asked, int16_t given, uint16_t *steps)
	.align 1
	.global _fix_excess
_fix_excess:
	cmp.w	r1,r0
	beq	.Lin_full
	mov.w	@r2,r3
	adds	#1,r3
	mov.w	r3,r3
	beq	.Lexcess_counted
	mov.w	r3,@r2
.Lexcess_counted:
	cmp.w	r1,r0
	bgt	.Lmore
	mov.w	#-1,r0
	rts
.Lmore:
	mov.w	#1,r0
	rts
.Lin_full:
	sub.w	r0,r0
	rts
