; trig_h8.S: trig.c's functions in the RCX's own instructions: see h8.inc. The tables are trig.c's.
	.include "core/h8.inc"
	.text

; The curve r0 at r1, a place in 256ths: to r0. Uses r1 to r3.
.Lvalue:
	mov.w	r4,@-r7
	mov.w	r5,@-r7
	mov.b	r1h,r2l
	shlr	r2l
	shlr	r2l
	shlr	r2l
	sub.b	r2h,r2h
	add.w	r2,r2
	add.w	r0,r2
	mov.w	@r2,r3		; the eighth before
	mov.w	@(2,r2),r2
	sub.w	r3,r2
	.rept	3
	shlr	r2h
	rotxr	r2l
	.endr			; r2 the chord's slope
	mov.b	r1h,r4l
	shlr	r4l
	sub.b	r4h,r4h
	add.w	r0,r4
	mov.b	@(66,r4),r5l	; the bends of two values
	mov.b	r5l,r5h
	shlr	r5h
	shlr	r5h
	shlr	r5h
	shlr	r5h
	and	#15,r5l
	btst	#0,r1h
	bne	.Lbends		; of this value and the next
	mov.b	r5h,r5l		; of the next and the one behind it; this value's stands before them
	sub.b	r5h,r5h
	mov.b	r1h,r0l
	and	#7,r0l
	beq	.Lbends
	mov.b	@(65,r4),r5h
	and	#15,r5h
.Lbends:			; r5h this value's, r5l the next one's
	add.b	r2l,r5l
	sub.b	r5h,r5l
	mov.b	r5l,r4l
	mulxu.b	r1l,r4		; the step to the next value, times the rest of the place
	add.b	#128,r4l
	addx	#0,r4h
	and	#7,r1h
	mulxu.b	r1h,r2
	add.w	r2,r3
	add.b	r5h,r3l
	addx	#0,r3h
	add.b	r4h,r3l
	addx	#0,r3h
	mov.w	r3,r0
	mov.w	@r7+,r5
	mov.w	@r7+,r4
	rts

; int16_t trig_cos_q15(uint16_t angle_bam16), trig_sin_q15
	.align 1
	.global _trig_cos_q15
_trig_cos_q15:
	add.b	#0x40,r0h
	.global _trig_sin_q15
_trig_sin_q15:
	mov.w	r0,@-r7
	and	#0x7f,r0h
	mov.w	r0,r1
	mov.w	#0x4000,r2
	cmp.w	r2,r1
	bcs	.Lrising
	beq	.Lpeak
	mov.w	#0x8000,r1
	sub.w	r0,r1
.Lrising:
	add.w	r1,r1
	add.w	r1,r1
	mov.w	#_trig_sine_q15,r0
	jsr	@.Lvalue
.Lsigned:
	mov.w	@r7+,r2
	bmi	.Lnegative
	rts
.Lpeak:
	mov.w	#0x7fff,r0
	bra	.Lsigned
.Lnegative:
	not	r0h
	not	r0l
	adds	#1,r0
	rts

; uint16_t trig_atan2_bam16(const int32_t *y, const int32_t *x): r4:r5 and r0:r1 their magnitudes; y's sign is on the stack, x's in r6l.
	.align 1
	.global _trig_atan2_bam16
_trig_atan2_bam16:
	SAVE
	mov.w	r1,r6
	mov.w	@(2,r0),r1
	mov.w	@r0,r0
	mov.w	r0,@-r7
	jsr	@_fix_abs_u32
	mov.w	r0,r4
	mov.w	r1,r5
	mov.w	@r6,r0
	mov.w	@(2,r6),r1
	mov.b	r0h,r6l
	jsr	@_fix_abs_u32
.Lhalve:			; until both have 16 bits
	mov.w	r0,r2
	or	r4l,r2l
	or	r4h,r2h
	or	r2h,r2l
	beq	.Lhalved
	shlr	r0h
	rotxr	r0l
	rotxr	r1h
	rotxr	r1l
	shlr	r4h
	rotxr	r4l
	rotxr	r5h
	rotxr	r5l
	bra	.Lhalve
.Lhalved:
	cmp.w	r5,r1
	bcs	.Lsteep
	bne	.Lflat
	mov.w	r1,r0
	beq	.Lquadrant
	mov.w	#0x2000,r0	; a diagonal
	bra	.Lquadrant
.Lsteep:
	mov.w	r1,r0
	mov.w	r5,r2
	bsr	.Loctant
	mov.w	#0x4000,r1
	sub.w	r0,r1
	mov.w	r1,r0
	bra	.Lquadrant
.Lflat:
	mov.w	r5,r0
	mov.w	r1,r2
	bsr	.Loctant
.Lquadrant:
	mov.b	r6l,r6l
	bpl	.Lforward
	mov.w	#0x8000,r1
	sub.w	r0,r1
	mov.w	r1,r0
.Lforward:
	mov.w	@r7+,r1
	bpl	.Lright
	not	r0h
	not	r0l
	adds	#1,r0
.Lright:
	mov.w	@r7+,r6
	mov.w	@r7+,r5
	mov.w	@r7+,r4
	rts

; The angle of r2 along and r0 across, less: to r0.
.Loctant:
	sub.w	r1,r1
	jsr	@_fix_div_u32
	mov.w	#_trig_arctan_bam16_q2,r0
	jsr	@.Lvalue
	adds	#2,r0
	shlr	r0h
	rotxr	r0l
	shlr	r0h
	rotxr	r0l
	rts
