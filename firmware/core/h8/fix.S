; fix.S: the arithmetic of fix.h in the RCX's own instructions. macros.inc explains calls, registers and inner routines.
	.include "core/h8/macros.inc"
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

; int32_t fix_mul(int16_t a, int16_t b): the product of both taken without sign, minus 65536 times the other for each negative one.
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

; int32_t fix_add(int16_t a, int16_t b): the signs of both, and the carry, make the high word's two bytes.
	.align 1
	.global _fix_add
_fix_add:
	bld	#7,r0h
	subx	r2l,r2l
	bld	#7,r1h
	subx	r2h,r2h
	add.w	r0,r1
	addx	r2h,r2l
	mov.b	r2l,r0l
	mov.b	r2l,r0h
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
	bra	.Lend_mul

; int32_t fix_mul_q15(int32_t value, int16_t factor_q15)
	.align 1
	.global _fix_mul_q15
_fix_mul_q15:
	SAVE
	mov.b	r0h,r4l
	xor	r2h,r4l		; the sign
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
	bcc	.Lend_mul
	mov.w	r5,r1		; the factor is 2^15: the whole value, but at most 2^31 - 1
	bpl	.Lfits
	subs	#1,r1
	subs	#1,r2
.Lfits:
	mov.w	r4,r0
	bra	.Lrestore_and_cut

; Inner routine, the end of a function that began with SAVE: returns r5:r2 * r6 / 2^16 (all without sign), cut, with the
; sign of r4l.
.Lend_mul:
	mov.b	#0x80,r4h
	bsr	_fix_inner_multiply

; Inner routine, the end of a function that began with SAVE: restores r4 to r6, then as .Lcut.
.Lrestore_and_cut:
	mov.w	@r7+,r6
	mov.w	@r7+,r5
	mov.w	@r7+,r4

; Inner routine: returns r1:r2 (without sign) in r0:r1, negated where bit 7 of r0l is set.
.Lcut:
	andc	#0xfe,ccr

; Inner routine: the same, with 1 added to r1:r2 where the carry is set.
	.global _fix_inner_round
_fix_inner_round:
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
	mov.w	#0,r0		; not sub.w, which would change the carry
	mov.w	r0,r1
	subx	r2l,r1l
	subx	r2h,r1h
	subx	r3l,r0l
	subx	r3h,r0h
	rts

; int32_t fix_trunc_shift(int32_t value, uint8_t bits)
	.align 1
	.global _fix_trunc_shift
_fix_trunc_shift:
	bsr	.Lmagnitude_shift
	bra	.Lcut

; int32_t fix_round_shift(int32_t value, uint8_t bits)
	.align 1
	.global _fix_round_shift
_fix_round_shift:
	bsr	.Lmagnitude_shift
	bra	_fix_inner_round

; Inner routine: the magnitude of r0:r1, divided by 2^r2l, in r1:r2; the last bit that fell off in the carry; the sign in r0l.
.Lmagnitude_shift:
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

; Inner routine: r5:r2 * r6 / 2^16, all without sign, in r1:r2, and r4 in r0. Where bit 7 of r4h is clear, the product is
; also divided by 2^r4h (0 to 31), and the carry is the last bit that fell off. Keeps r4 alone.
	.align 1
	.global _fix_inner_multiply
_fix_inner_multiply:
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
	bpl	.Lshift
	rts

; Inner routine: r1:r2 (without sign) / 2^r0h in r1:r2, cut; r0h is 0 to 31. The carry is the last bit that fell off; where
; r0h is 0, that is bit 7 of r3l. Uses r0h and r3l. Shifts bytes, then bits: to the right, or to the left after one byte more.
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

; int32_t fix_dot(const fix_vector_t *of, const fix_vector_t *with)
	.align 1
	.global _fix_dot
_fix_dot:
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
	jmp	@_end_two_saved

; int16_t fix_compare_square(int32_t value, uint16_t root): value minus square; the low word only tells whether it is 0.
	.align 1
	.global _fix_compare_square
_fix_compare_square:
	PUSH32
	mov.w	r2,r0
	mov.w	r2,r1
	jsr	@_fix_mul_u16
	mov.w	@r7+,r2
	mov.w	@r7+,r3
	sub.w	r1,r3
	subx	r0l,r2l
	subx	r0h,r2h
	mov.w	r2,r0
	or	r3h,r0l
	or	r3l,r0l
	rts

; int32_t fix_add32(int32_t a, int32_t b), fix_sub32: b is on the stack. Signs tell whether the result overflows, since the
; simulator sets V wrongly after ADDX and SUBX.
	.align 1
	.global _fix_add32
_fix_add32:
	mov.w	@(2,r7),r2
	mov.w	@(4,r7),r3
	add.w	r3,r1
	mov.b	r0h,r3h
	addx	r2l,r0l
	addx	r2h,r0h
	xor	r0h,r2h
	xor	r0h,r3h
	and	r2h,r3h
	bmi	.Lwrong_sign32	; the sum has neither's sign
	bra	.Lsymmetric32

	.align 1
	.global _fix_sub32
_fix_sub32:
	mov.w	@(2,r7),r2
	mov.w	@(4,r7),r3
	sub.w	r3,r1
	mov.b	r0h,r3h
	subx	r2l,r0l
	subx	r2h,r0h
	xor	r3h,r2h
	xor	r0h,r3h
	and	r2h,r3h
	bmi	.Lwrong_sign32

; Inner routine: returns r0:r1, but -(2^31 - 1) for -2^31.
.Lsymmetric32:
	mov.w	#0x8000,r2
	cmp.w	r2,r0
	bne	.Lsum
	mov.w	r1,r1
	bne	.Lsum
	adds	#1,r1
.Lsum:
	rts

; Inner routine: returns 2^31 - 1 with the sign that r0:r1 has not.
.Lwrong_sign32:
	mov.w	r0,r0
	bmi	.Lmost32
	mov.w	#0x8000,r0
	mov.w	#1,r1
	rts
.Lmost32:
	mov.w	#0x7fff,r0
	mov.w	#0xffff,r1
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

; int32_t fix_to_q8(int16_t value)
	.align 1
	.global _fix_to_q8
_fix_to_q8:
	sub.b	r1l,r1l
	mov.b	r0l,r1h
	mov.b	r0h,r0l
	bld	#7,r0h
	subx	r0h,r0h
	rts

; int32_t fix_mul32_u8(int32_t value, uint8_t factor): byte by byte, the lowest first
	.align 1
	.global _fix_mul32_u8
_fix_mul32_u8:
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

; int16_t fix_reciprocal_q15(uint8_t value)
	.align 1
	.global _fix_reciprocal_q15
_fix_reciprocal_q15:
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

; uint8_t fix_bit_length(uint16_t count, uint8_t most)
	.align 1
	.global _fix_bit_length
_fix_bit_length:
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

; int16_t fix_mul16_q10(int16_t gain_q10, int16_t value)
	.align 1
	.global _fix_mul16_q10
_fix_mul16_q10:
	jsr	@_fix_mul_q10
	jmp	@_fix_sat16

; int16_t fix_round_shift16(int32_t value, uint8_t bits)
	.align 1
	.global _fix_round_shift16
_fix_round_shift16:
	jsr	@_fix_round_shift
	jmp	@_fix_sat16

; int16_t fix_sat16(int32_t value)
	.align 1
	.global _fix_sat16
_fix_sat16:
	bld	#7,r1h
	subx	r2l,r2l		; both bytes of the high word where the value fits
	cmp.b	r2l,r0l
	bne	.Lbeyond16
	cmp.b	r2l,r0h
	bne	.Lbeyond16
	mov.w	r1,r0
	bra	.Lsymmetric16
.Lbeyond16:
	mov.w	r0,r0
	bmi	.Lleast16

; Inner routine: returns 32767.
.Lmost16:
	mov.w	#0x7fff,r0
	rts

; int16_t fix_add16(int16_t a, int16_t b): where it overflows, the sum's sign is the wrong one.
	.align 1
	.global _fix_add16
_fix_add16:
	add.w	r1,r0
	bvc	.Lsymmetric16
	bmi	.Lmost16
	bra	.Lleast16

; int16_t fix_sub16(int16_t a, int16_t b): the same.
	.align 1
	.global _fix_sub16
_fix_sub16:
	sub.w	r1,r0
	bvc	.Lsymmetric16
	bmi	.Lmost16
	bra	.Lleast16

; Inner routine: returns r0, but -32767 for -32768.
.Lsymmetric16:
	mov.w	#0x8000,r2
	cmp.w	r2,r0
	beq	.Lleast16
	rts

; Inner routine: returns -32767.
.Lleast16:
	mov.w	#0x8001,r0
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

; uint16_t fix_increment_u16(uint16_t count): goes on as fix_add_u16(count, 1)
	.align 1
	.global _fix_increment_u16
_fix_increment_u16:
	mov.w	#1,r1

; uint16_t fix_add_u16(uint16_t a, uint16_t b)
	.global _fix_add_u16
_fix_add_u16:
	add.w	r1,r0
	bcc	.Lfits_u16
	mov.w	#0xffff,r0
.Lfits_u16:
	rts

; uint16_t fix_round_bam16(uint32_t angle_bam32): adds 2^15, or 2^15 - 1 to a negative one; returns the high word.
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
	not	r0h
	not	r0l
	adds	#1,r0
.Labsolute16:
	rts

; uint32_t fix_abs_u32(int32_t value)
	.align 1
	.global _fix_abs_u32
_fix_abs_u32:
	mov.w	r0,r0
	bpl	.Labsolute
	NEGATE	r0h,r0l,r1h,r1l
.Labsolute:
	rts

; int32_t fix_mul_q10(int16_t gain_q10, int16_t value)
	.align 1
	.global _fix_mul_q10
_fix_mul_q10:
	jsr	@_fix_mul
	mov.b	#10,r2l
	jmp	@_fix_round_shift

; int32_t fix_mul_q16(int32_t value, uint16_t factor_q16)
	.align 1
	.global _fix_mul_q16
_fix_mul_q16:
	mov.w	r0,@-r7
	jsr	@_fix_abs_u32
	jsr	@_fix_mul_u32_q16
	mov.w	@r7+,r2
	bpl	.Lpositive_share
	NEGATE	r0h,r0l,r1h,r1l
.Lpositive_share:
	rts

; int16_t fix_mul16_q15(int16_t value, int16_t factor_q15)
	.align 1
	.global _fix_mul16_q15
_fix_mul16_q15:
	mov.w	r1,r2
	beq	.Lno_share
	mov.w	r0,r1
	mov.b	r0h,r0l
	add.b	r0l,r0l
	subx	r0l,r0l
	mov.b	r0l,r0h
	jsr	@_fix_mul_q15
	jmp	@_fix_sat16
.Lno_share:
	sub.w	r0,r0
	rts

; int8_t fix_compare16(int16_t a, int16_t b)
	.align 1
	.global _fix_compare16
_fix_compare16:
	cmp.w	r1,r0
	beq	.Lin_full
	bgt	.Lmore
	mov.b	#-1,r0l
	rts
.Lmore:
	mov.b	#1,r0l
	rts
.Lin_full:
	sub.w	r0,r0
	rts
