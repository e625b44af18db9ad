; motor_h8.s: motor.h in the RCX's own instructions: see core/h8.inc. Scales, and values of 32 bits, take 4 bytes.
	.include "core/h8.inc"
	.text

; void motor_step(const motor_coefficients_t *coefficients, motor_state_t *state, int16_t voltage_mv, int32_t load_mrad_s_q13): the load
; is on the stack. r4 walks along both rows of the coefficients, r5 is the state, r6 the voltage.
	.align 1
	.global _motor_step
_motor_step:
	SAVE
	mov.w	r0,r4
	mov.w	r1,r5
	mov.w	r2,r6
	bsr	.Lrow
	mov.w	r1,@-r7		; the new current
	mov.w	r0,@-r7
	bsr	.Lrow
	mov.w	@(12,r7),r2
	mov.w	@(14,r7),r3
	add.w	r3,r1
	addx	r2l,r0l
	addx	r2h,r0h
	mov.w	@r7+,r2
	mov.w	r2,@r5
	mov.w	@r7+,r2
	mov.w	r2,@(2,r5)
	adds	#2,r5
	adds	#2,r5
	mov.w	r5,r2
	jsr	@_fix_add_to
	mov.w	#12000,r2	; MOTOR_SPEED_LIMIT_MRAD_S_Q13 / 65536
	jsr	@_fix_clamp_q16
	mov.w	r0,@r5
	mov.w	r1,@(2,r5)
	mov.w	@r7+,r6
	mov.w	@r7+,r5
	mov.w	@r7+,r4
	rts

; A row's sum; r4 moves on to the next.
.Lrow:
	mov.w	r4,r0
	add.b	#8,r0l
	addx	#0,r0h
	mov.w	r6,r1
	jsr	@_scale_apply16
	bsr	.Lterm
	bsr	.Lterm
	add.b	#-8,r5l
	addx	#-1,r5h
	adds	#2,r4
	adds	#2,r4
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
