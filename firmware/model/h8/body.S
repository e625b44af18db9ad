; body.S: the profile `coupled` of body.h in the RCX's own instructions: see core/h8/macros.inc. In a build without `paper` these
; are the functions of body.h; in another, body.c calls them.
#include "core/h8/layout.h"
#include "model/limits.h"
	.include "core/h8/macros.inc"

#if STATE_MOTOR != 0 || STATE_MOTOR_1 - STATE_MOTOR != MOTION_YAW_RATE - MOTION_SURGE
#error ".Lfrom_wheel needs the yaw rate as far behind the second motor as the surge is behind the first"
#endif

; Returns in r0:r1 what a scale of the coefficients at r4 makes of r1:r2.
	.macro	APPLY	scale
	mov.w	r4,r0
	add.b	#\scale,r0l
	addx	#0,r0h
	jsr	@_scale_apply
	.endm

#ifndef BODY_WITHOUT_COUPLED
	.text

#ifndef BODY_WITHOUT_PAPER
#define _body_predict _body_h8_predict
#define _body_correct_surge _body_h8_correct_surge
#endif

; void body_predict(const body_coefficients_t *coefficients, body_state_t *state, int16_t left_mv, int16_t right_mv): r4 and r5 are the
; first two, the right voltage is on the stack.
	.align 1
	.global _body_predict
_body_predict:
	jsr	@_begin_saved
	mov.w	r0,r4
	mov.w	r1,r5
#ifdef BODY_WITHOUT_PAPER
	mov.w	@(8,r7),r0
	mov.w	#MOTOR_VOLTAGE_LIMIT_MV,r1
	jsr	@_fix_clamp16
	mov.w	r0,r6
	mov.w	r2,r0
	mov.w	#MOTOR_VOLTAGE_LIMIT_MV,r1
	jsr	@_fix_clamp16
#else
	mov.w	@(8,r7),r6
	mov.w	r2,r0
#endif
	mov.w	r0,r1
	sub.w	r6,r1
	mov.w	r1,@-r7		; the difference
	add.w	r0,r6		; the sum
	mov.w	@(STATE_MOTION + MOTION_SURGE,r5),r0
	mov.w	@(STATE_MOTION + MOTION_SURGE + 2,r5),r1
	jsr	@_fix_abs_u32
	mov.w	r0,r1
	jsr	@_fix_mul_u16
	mov.w	r1,r2
	mov.w	r0,r1
	APPLY	COEFFICIENTS_DRAG
	mov.b	@(STATE_MOTION + MOTION_SURGE,r5),r2l
	bmi	.Ldrag
	mov.w	r0,r2
	mov.w	r1,r3
	sub.w	r0,r0
	sub.w	r1,r1
	SUB32
.Ldrag:
	PUSH32
	mov.w	r4,r0
	adds	#COEFFICIENTS_MOTOR,r0
	mov.w	r5,r1
	mov.w	r6,r2
	jsr	@_motor_step
	adds	#2,r7
	adds	#2,r7
	mov.w	@r7+,r2
	sub.w	r0,r0
	mov.w	r0,@-r7
	mov.w	r0,@-r7
	mov.w	r4,r0
	add.b	#COEFFICIENTS_MOTOR_1,r0l
	addx	#0,r0h
	mov.w	r5,r6
	add.b	#STATE_MOTOR_1,r6l
	addx	#0,r6h
	mov.w	r6,r1
	jsr	@_motor_step
	adds	#2,r7
	adds	#2,r7
	mov.b	#COEFFICIENTS_YAW_RATE_FROM_WHEEL,r0l
	bsr	.Lfrom_wheel

; Inner routine, the end of a function that began with SAVE: sets the surge from the speed of the mean wheel.
.Lsurge:
	mov.w	r5,r6
	mov.b	#COEFFICIENTS_SURGE_FROM_WHEEL,r0l
	bsr	.Lfrom_wheel
	LEAVE

; Inner routine: sets the velocity of the motor at r6 by the scale r0l bytes behind r4: the surge is as far behind the first
; motor as the yaw rate is behind the second.
.Lfrom_wheel:
	sub.b	r0h,r0h
	add.w	r4,r0
	mov.w	@(MOTOR_SPEED,r6),r1
	mov.w	@(MOTOR_SPEED + 2,r6),r2
	jsr	@_scale_apply
	mov.w	r0,@(STATE_MOTION + MOTION_SURGE,r6)
	mov.w	r1,@(STATE_MOTION + MOTION_SURGE + 2,r6)
	rts

; void body_correct_surge(const body_coefficients_t *coefficients, body_state_t *state, int32_t change_mm_s_q17): the change is on the
; stack. The four quarters are added two at a time: they have one sign, so that the sum saturates the same way.
	.align 1
	.global _body_correct_surge
_body_correct_surge:
	jsr	@_begin_saved
	mov.w	r0,r4
	mov.w	r1,r5
	mov.w	@(8,r7),r1
	mov.w	@(10,r7),r2
	APPLY	COEFFICIENTS_QUARTER_WHEEL_FROM_SURGE
	add.w	r1,r1
	rotxl	r0l
	rotxl	r0h
	PUSH32
	mov.w	@(MOTOR_SPEED,r5),r0
	mov.w	@(MOTOR_SPEED + 2,r5),r1
	jsr	@_fix_add32
	jsr	@_fix_add32
	adds	#2,r7
	adds	#2,r7
	mov.w	#MOTOR_SPEED_LIMIT_MRAD_S_Q13_HIGH,r2
	jsr	@_fix_clamp_q16
	mov.w	r0,@(MOTOR_SPEED,r5)
	mov.w	r1,@(MOTOR_SPEED + 2,r5)
	jmp	@.Lsurge
#endif
