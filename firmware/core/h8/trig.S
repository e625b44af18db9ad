; trig.S: the functions of trig.h in the RCX's own instructions: see macros.inc. The tables are those of trig.c.
#include "core/h8/layout.h"
#include "core/turns.h"
	.include "core/h8/macros.inc"
	.text

#if CURVE_EVERY_8TH != 0
#error "a curve is taken for its first table"
#endif

; Inner routine: the value of the curve at r0, at the place r1 in 256ths, in r0. Keeps r4 to r6.
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
	mov.b	@(CURVE_BENDS,r4),r5l	; the bends of two values
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
	mov.b	@(CURVE_BENDS - 1,r4),r5h
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
	jmp	@_end_two_saved

; int16_t trig_cos_q15(uint16_t angle_bam16): goes on as trig_sin_q15 of a quarter turn more
	.align 1
	.global _trig_cos_q15
_trig_cos_q15:
	add.b	#TURN_QUARTER / 256,r0h

; int16_t trig_sin_q15(uint16_t angle_bam16)
	.global _trig_sin_q15
_trig_sin_q15:
	mov.w	r0,@-r7
	and	#0x7f,r0h
	mov.w	r0,r1
	mov.w	#TURN_QUARTER,r2
	cmp.w	r2,r1
	bcs	.Lrising
	beq	.Lpeak
	mov.w	#TURN_HALF,r1
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

; uint16_t trig_atan2_bam16(int32_t y, int32_t x): x is on the stack. r4:r5 and r0:r1 become the magnitudes of y and x; the sign of y goes
; onto the stack, that of x into r6l.
	.align 1
	.global _trig_atan2_bam16
_trig_atan2_bam16:
	jsr	@_begin_saved
	mov.w	r0,@-r7
	jsr	@_fix_abs_u32
	mov.w	r0,r4
	mov.w	r1,r5
	mov.w	@(10,r7),r0
	mov.w	@(12,r7),r1
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
	mov.w	#TURN_EIGHTH,r0	; a diagonal
	bra	.Lquadrant
.Lsteep:
	mov.w	r1,r0
	mov.w	r5,r2
	bsr	.Loctant
	mov.w	#TURN_QUARTER,r1
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
	mov.w	#TURN_HALF,r1
	sub.w	r0,r1
	mov.w	r1,r0
.Lforward:
	mov.w	@r7+,r1
	bpl	.Lright
	not	r0h
	not	r0l
	adds	#1,r0
.Lright:
	jmp	@_end_saved

; Inner routine: the angle of a vector with r2 along and r0 across, r0 less than r2, in r0.
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
