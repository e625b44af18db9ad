; divide.S: quotient and square root of fix.h in the RCX's own instructions: see macros.inc.
	.include "core/h8/macros.inc"
	.text

; uint32_t fix_div_u32(uint32_t dividend, uint16_t divisor): both doubled until the divisor (r2) has its highest bit, the dividend into
; r3:r0:r1; then by bytes of the quotient. r3 is the rest.
	.align 1
	.global _fix_div_u32
_fix_div_u32:
	sub.w	r3,r3
	mov.w	r2,r2
	bmi	.Lnormal
	beq	.Lby_nothing
.Lnormalize:
	add.w	r1,r1
	rotxl	r0l
	rotxl	r0h
	rotxl	r3l
	rotxl	r3h
	add.w	r2,r2
	bpl	.Lnormalize
.Lnormal:
	mov.w	r3,r3
	bne	.Llong
	cmp.w	r2,r0
	bcc	.Llong
	mov.w	r0,r3
	bsr	.Ldivide
	sub.w	r0,r0
	rts
.Llong:
	mov.w	r1,@-r7
	mov.w	r0,r1
	bsr	.Ldivide
	mov.w	@r7+,r0
	mov.w	r1,@-r7
	mov.w	r0,r1
	bsr	.Ldivide
	mov.w	@r7+,r0
	rts
.Lby_nothing:
	mov.w	#0xffff,r0
	mov.w	r0,r1
	rts

; Inner routine: r3:r1 / r2 in r1, the rest in r3; r3 is less than r2. Uses r0. Finds a byte of the quotient, twice: it is at
; most the rest by the divisor's high byte, and less where the part of the low byte is too large.
.Ldivide:
	bsr	.Lquotient_byte
.Lquotient_byte:
	cmp.b	r2h,r3h
	bcc	.Lfrom_256
	divxu.b	r2h,r3
	mov.b	r3l,r0l
	mov.b	r1h,r3l
	mov.b	r0l,r1h
	mulxu.b	r2l,r0
	sub.w	r0,r3
	bcc	.Lnot_less
.Lless:
	dec	r1h
	add.w	r2,r3
	bcc	.Lless
.Lnot_less:
	mov.b	r1h,r0l
	mov.b	r1l,r1h
	mov.b	r0l,r1l
	rts
.Lfrom_256:			; one less at least
	sub.b	r2l,r3l
	mov.b	r3l,r3h
	mov.b	r1h,r3l
	sub.b	r1h,r1h
	bra	.Lless

; uint16_t fix_sqrt_u32(uint32_t value): moves two bits of the value at a time into the rest (r2l:r3) and finds one bit of the root
; (r4) by a trial (r2h:r5): 8 for each word of the value.
	.align 1
	.global _fix_sqrt_u32
_fix_sqrt_u32:
	jsr	@_begin_saved
	sub.b	r2l,r2l
	sub.w	r3,r3
	sub.w	r4,r4
	mov.b	#8,r6l
	bsr	.Lroot
	mov.w	r1,r0
	mov.b	#8,r6l
	bsr	.Lroot
	mov.w	r4,r0
	jmp	@_end_saved

; Inner routine: takes the bits of r0 into the rest, r6l times two of them, and makes as many bits of the root.
.Lroot:
	.rept	2
	add.w	r0,r0
	rotxl	r3l
	rotxl	r3h
	rotxl	r2l
	.endr
	add.w	r4,r4
	sub.b	r2h,r2h
	mov.w	r4,r5
	add.w	r5,r5
	rotxl	r2h
	adds	#1,r5
	sub.w	r5,r3
	subx	r2h,r2l
	bcs	.Lroot_zero
	adds	#1,r4
	dec	r6l
	bne	.Lroot
	rts
.Lroot_zero:
	add.w	r5,r3
	addx	r2h,r2l
	dec	r6l
	bne	.Lroot
	rts
