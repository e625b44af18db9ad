; fix_h8.s: the arithmetic of fix.h that a step spends most of its time in, in the RCX's own instructions: see h8.inc.
	.include "core/h8.inc"
	.text

; uint32_t fix_mul_u16(uint16_t a, uint16_t b)
	.align 1
	.global _fix_mul_u16
_fix_mul_u16:
	PRODUCT
	mov.b	r2l,r1l
	mov.b	r0l,r1h
	mov.w	r3,r0
	rts

; int32_t fix_mul(int16_t a, int16_t b): the product of both without sign, less 65536 times the other for each that is negative.
	.align 1
	.global _fix_mul
_fix_mul:
	mov.w	r0,@-r7
	mov.w	r1,@-r7
	PRODUCT
	mov.b	r2l,r1l
	mov.b	r0l,r1h
	mov.w	@r7+,r2
	bpl	.Lsecond_positive
	mov.w	@r7,r0
	sub.w	r0,r3
.Lsecond_positive:
	mov.w	@r7+,r0
	bpl	.Lfirst_positive
	sub.w	r2,r3
.Lfirst_positive:
	mov.w	r3,r0
	rts

; uint32_t fix_mul_u32_q16(uint32_t a, uint16_t b)
	.align 1
	.global _fix_mul_u32_q16
_fix_mul_u32_q16:
	SAVE
	sub.b	r4h,r4h
	mov.w	r2,r6
	mov.w	r1,r2
	mov.w	r0,r5
	bra	.Lmultiply

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
	mov.b	r0h,r4h
	xor	r2h,r4h
	mov.w	r2,r6
	bpl	.Lfactor
	not	r6h
	not	r6l
	adds	#1,r6
.Lfactor:
	mov.w	r1,r2
	mov.w	r0,r5
	bpl	.Lvalue
	NEGATE	r5h,r5l,r2h,r2l
.Lvalue:
	add.w	r6,r6
	bcs	.Lall
.Lmultiply:
	PRODUCT_Q16
	.global _fix_h8_signed_result
_fix_h8_signed_result:
	mov.b	r4h,r4h
	bpl	.Lpositive
	NEGATE	r3h,r3l,r2h,r2l
.Lpositive:
	mov.w	r3,r0
	mov.w	r2,r1
	mov.w	@r7+,r6
	mov.w	@r7+,r5
	mov.w	@r7+,r4
	rts
.Lall:				; by 2^15: all of it, but at most 2^31 - 1
	mov.w	r5,r3
	bpl	.Lfits
	mov.w	#0x7fff,r3
	mov.w	#0xffff,r2
.Lfits:
	bra	_fix_h8_signed_result

; r3:r2 (without sign) / 2^r4l to r3:r2, cut; r4l 0 to 31. Uses r1l, r4l. Bytes, then bits: right, or left in a byte more.
	.align 1
	.global _fix_h8_shift
_fix_h8_shift:
.Lshift:
	cmp.b	#8,r4l
	bcs	.Lbits
	mov.b	r2h,r2l
	mov.b	r3l,r2h
	mov.b	r3h,r3l
	sub.b	r3h,r3h
	add.b	#-8,r4l
	bra	.Lshift
.Lbits:
	cmp.b	#5,r4l
	bcc	.Lleft
	mov.b	r4l,r4l
	beq	.Lshifted
.Lright:
	shlr	r3h
	rotxr	r3l
	rotxr	r2h
	rotxr	r2l
	add.b	#-1,r4l
	bne	.Lright
.Lshifted:
	rts
.Lleft:
	sub.b	r1l,r1l
.Lleft_again:
	add.w	r2,r2
	rotxl	r3l
	rotxl	r3h
	rotxl	r1l
	add.b	#1,r4l
	cmp.b	#8,r4l
	bne	.Lleft_again
	mov.b	r2h,r2l
	mov.b	r3l,r2h
	mov.b	r3h,r3l
	mov.b	r1l,r3h
	rts

; The same, r4l 1 to 31, rounded to the nearest, halves up.
	.align 1
	.global _fix_h8_round_shift
_fix_h8_round_shift:
.Lround_shift:
	add.b	#-1,r4l
	jsr	@.Lshift
	add.b	#1,r2l
	addx	#0,r2h
	addx	#0,r3l
	addx	#0,r3h
	shlr	r3h
	rotxr	r3l
	rotxr	r2h
	rotxr	r2l
	rts

; int32_t fix_fraction(int32_t value, uint8_t bits)
	.align 1
	.global _fix_fraction
_fix_fraction:
	SAVE
	mov.b	r0h,r4h
	mov.b	r2l,r4l
	mov.w	r1,r2
	mov.w	r0,r3
	bpl	.Lfraction
	NEGATE	r3h,r3l,r2h,r2l
.Lfraction:
	jsr	@.Lshift
	SIGNED_RESULT

; int32_t fix_round_shift(int32_t value, uint8_t bits)
	.align 1
	.global _fix_round_shift
_fix_round_shift:
	SAVE
	mov.b	r0h,r4h
	mov.b	r2l,r4l
	mov.w	r1,r2
	mov.w	r0,r3
	bpl	.Lround
	NEGATE	r3h,r3l,r2h,r2l
.Lround:
	jsr	@.Lround_shift
	SIGNED_RESULT

; int32_t fix_add32(int32_t a, int32_t b), fix_sub32: b is on the stack. By signs: the simulator sets V wrong after ADDX and SUBX.
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
	bmi	.Lbeyond	; the sum's sign is neither's
	mov.b	r0h,r0h
	bmi	.Lleast
	rts
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

	.macro	DIVIDE_ROUND
	add.w	r1,r1
	rotxl	r3l
	rotxl	r3h
	bcs	.Lone\@
	cmp.w	r2,r3
	bcs	.Lzero\@
.Lone\@:
	sub.w	r2,r3
	adds	#1,r1
.Lzero\@:
	.endm

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

; int16_t fix_sat16(int32_t value), fix_add16(int16_t a, int16_t b), fix_sub16: at most 32767 in magnitude
	.align 1
	.global _fix_sat16
_fix_sat16:
	mov.b	r1h,r2l
	add.b	r2l,r2l
	subx	r2l,r2l
	mov.b	r2l,r2h
	cmp.w	r2,r0
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

; uint32_t fix_abs_u32(int32_t value)
	.align 1
	.global _fix_abs_u32
_fix_abs_u32:
	mov.w	r0,r0
	bpl	.Labsolute
	NEGATE	r0h,r0l,r1h,r1l
.Labsolute:
	rts

; uint32_t fix_div_u32(uint32_t dividend, uint16_t divisor): each half by subtract and shift; r3 is the rest, r0l counts.
	.align 1
	.global _fix_div_u32
_fix_div_u32:
	sub.w	r3,r3
	cmp.w	r2,r0
	bcs	.Lhigh_is_rest
	mov.w	r1,@-r7
	mov.w	r0,r1
	bsr	.Ldivide_half
	mov.w	@r7+,r0
	mov.w	r1,@-r7
	mov.w	r0,r1
	bsr	.Ldivide_half
	mov.w	@r7+,r0
	rts
.Lhigh_is_rest:
	mov.w	r0,r3
	bsr	.Ldivide_half
	sub.w	r0,r0
	rts
.Ldivide_half:
	mov.b	#4,r0l
.Lfour_rounds:
	DIVIDE_ROUND
	DIVIDE_ROUND
	DIVIDE_ROUND
	DIVIDE_ROUND
	add.b	#-1,r0l
	bne	.Lfour_rounds
	rts

; uint16_t fix_sqrt_u32(uint32_t value): two bits of the value at a time into the rest (r2l:r3), one of the root. r0:r1 value,
; r4 the root, r5 a trial, r6l counts. The rest stays within 16 bits for 13 rounds.
	.align 1
	.global _fix_sqrt_u32
_fix_sqrt_u32:
	SAVE
	sub.w	r3,r3
	sub.w	r4,r4
	mov.b	#13,r6l
.Lroot:
	.rept	2
	add.w	r1,r1
	rotxl	r0l
	rotxl	r0h
	rotxl	r3l
	rotxl	r3h
	.endr
	add.w	r4,r4
	mov.w	r4,r5
	add.w	r5,r5
	adds	#1,r5
	cmp.w	r5,r3
	bcs	.Lzero
	sub.w	r5,r3
	adds	#1,r4
.Lzero:
	add.b	#-1,r6l
	bne	.Lroot
	mov.b	#3,r6l
	sub.b	r2l,r2l
.Lwide_root:
	.rept	2
	add.w	r1,r1
	rotxl	r0l
	rotxl	r0h
	rotxl	r3l
	rotxl	r3h
	rotxl	r2l
	.endr
	add.w	r4,r4
	sub.b	r2h,r2h
	mov.w	r4,r5
	add.w	r5,r5
	rotxl	r2h		; the trial's third byte
	adds	#1,r5
	cmp.b	r2h,r2l
	bcs	.Lwide_zero
	bne	.Lwide_one
	cmp.w	r5,r3
	bcs	.Lwide_zero
.Lwide_one:
	sub.w	r5,r3
	subx	r2h,r2l
	adds	#1,r4
.Lwide_zero:
	add.b	#-1,r6l
	bne	.Lwide_root
	mov.w	r4,r0
	mov.w	@r7+,r6
	mov.w	@r7+,r5
	mov.w	@r7+,r4
	rts

; int32_t fix_share_q16(int32_t value, uint16_t factor_q16)
	.align 1
	.global _fix_share_q16
_fix_share_q16:
	SAVE
	mov.b	r0h,r4h
	mov.w	r2,r6
	mov.w	r1,r2
	mov.w	r0,r5
	bpl	.Lshare
	NEGATE	r5h,r5l,r2h,r2l
.Lshare:
	jmp	@.Lmultiply

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
	beq	.Lcounted
	mov.w	r3,@r2
.Lcounted:
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
