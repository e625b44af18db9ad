; motor_h8.S: motor.h in the RCX's own instructions: see core/h8.inc. Scales, and values of 32 bits, take 4 bytes.
	.include "core/h8.inc"
	.text

; void motor_step(const motor_coefficients_t *coefficients, motor_state_t *state, int16_t voltage_mv, int32_t load_mrad_s_q13): the load
; is on the stack. One value after the other goes into both rows' sums. On the stack then, a word each: the state, the current's scale,
; sum (2), the voltage, the speed's scale, sum (2).
	.align 1
	.global _motor_step
_motor_step:
	SAVE
	mov.w	@(8,r7),r4
	mov.w	@(10,r7),r3
	mov.w	r3,@-r7
	mov.w	r4,@-r7
	mov.w	r0,r3
	add.b	#12,r3l
	addx	#0,r3h
	mov.w	r3,@-r7
	mov.w	r2,@-r7
	sub.w	r3,r3
	mov.w	r3,@-r7
	mov.w	r3,@-r7
	mov.w	r0,@-r7
	mov.w	r1,@-r7
	bsr	.Lvalue		; the current
	mov.w	@r7,r1
	adds	#2,r1
	adds	#2,r1
	bsr	.Lvalue		; the speed
	sub.w	r2,r2
	mov.w	@(8,r7),r5
	mov.b	r5h,r4l
	bpl	.Lvoltage
	not	r5h
	not	r5l
	adds	#1,r5
.Lvoltage:
	bsr	.Lboth
	mov.w	@r7+,r4
	adds	#2,r7
	mov.w	@r7+,r2
	mov.w	r2,@r4
	mov.w	@r7+,r2
	mov.w	r2,@(2,r4)
	adds	#2,r4
	adds	#2,r4
	adds	#2,r7
	adds	#2,r7
	mov.w	@r7+,r0
	mov.w	@r7+,r1
	mov.w	@r4,r2
	mov.w	@(2,r4),r3
	ADD32
	mov.w	#12000,r2	; MOTOR_SPEED_LIMIT_MRAD_S_Q13 / 65536
	jsr	@_fix_clamp_q16
	mov.w	r0,@r4
	mov.w	r1,@(2,r4)
	LEAVE

; The value at r1, by both scales, to both sums. Twice as large: the voltage's scale gives 65536 times as much, but its word is in the place
; of the high one.
.Lvalue:
	mov.w	@(2,r1),r2
	mov.w	@r1,r5
	mov.b	r5h,r4l
	bpl	.Lpositive
	mov.w	r2,r3
	mov.w	r5,r1
	sub.w	r5,r5
	sub.w	r2,r2
	sub.w	r3,r2
	subx	r1l,r5l
	subx	r1h,r5h
.Lpositive:
	add.w	r2,r2
	rotxl	r5l
	rotxl	r5h

; The same of r5:r2, without sign, which is bit 7 of r4l: first the current's, whose place is 8 bytes lower, and the stack too. Then
.Lboth:
	mov.w	r2,@-r7
	mov.w	r5,@-r7
	mov.w	r4,@-r7
	bsr	.Lone
	mov.w	@r7+,r4
	mov.w	@r7+,r5
	mov.w	@r7+,r2
.Lone:
	mov.w	@(12,r7),r3
	mov.w	@r3+,r6
	mov.w	@r3+,r0
	mov.w	r3,@(12,r7)
	mov.b	r0h,r4h
	xor	r6h,r4l
	mov.w	r6,r6
	bpl	.Lmantissa
	not	r6h
	not	r6l
	adds	#1,r6
.Lmantissa:
	jsr	@_fix_h8_scaled
	mov.w	@(14,r7),r3
	mov.w	@(16,r7),r5
	mov.b	r0l,r0l
	bmi	.Lminus
	addx	r2l,r5l
	addx	r2h,r5h
	addx	r1l,r3l
	addx	r1h,r3h
.Lsum:
	mov.w	r3,@(14,r7)
	mov.w	r5,@(16,r7)
	rts
.Lminus:
	subx	r2l,r5l
	subx	r2h,r5h
	subx	r1l,r3l
	subx	r1h,r3h
	bra	.Lsum
