; body_h8.S: the profile `coupled` of body.h in the RCX's own instructions: see core/h8.inc. A build without `paper` has no more; another
; calls it from body.c.
	.include "core/h8.inc"
#define H8_ASSEMBLY
#include "model/body_h8.h"
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
	SAVE
	mov.w	r0,r4
	mov.w	r1,r5
#ifdef BODY_WITHOUT_PAPER
	mov.w	@(8,r7),r0
	mov.w	#16383,r1	; MOTOR_VOLTAGE_LIMIT_MV
	jsr	@_fix_clamp16
	mov.w	r0,r6
	mov.w	r2,r0
	mov.w	#16383,r1
	jsr	@_fix_clamp16
#else
	mov.w	@(8,r7),r6
	mov.w	r2,r0
#endif
	mov.w	r0,r1
	sub.w	r6,r1
	mov.w	r1,@-r7		; the difference
	add.w	r0,r6		; the sum
	mov.w	@(STATE_SURGE,r5),r0
	mov.w	@(STATE_SURGE + 2,r5),r1
	jsr	@_fix_abs_u32
	mov.w	r0,r1
	jsr	@_fix_mul_u16
	mov.w	r1,r2
	mov.w	r0,r1
	mov.b	#COEFFICIENTS_DRAG,r0l
	jsr	@_scale_h8_at
	mov.b	@(STATE_SURGE,r5),r2l
	bmi	.Ldrag
	mov.w	r0,r2
	mov.w	r1,r3
	sub.w	r0,r0
	sub.w	r1,r1
	SUB32
.Ldrag:
	PUSH32
	mov.w	r4,r0
	adds	#2,r0		; COEFFICIENTS_MOTOR_0
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

; The surge from the mean wheel's speed: the end of a function that began with SAVE.
.Lsurge:
	mov.w	r5,r6
	mov.b	#COEFFICIENTS_SURGE_FROM_WHEEL,r0l
	bsr	.Lfrom_wheel
	LEAVE

; By the coefficient r0l, of the motor at r6: where the yaw rate is, seen from the second motor, the surge is, seen from the first.
.Lfrom_wheel:
	mov.w	@(STATE_SPEED_0,r6),r1
	mov.w	@(STATE_SPEED_0 + 2,r6),r2
	jsr	@_scale_h8_at
	mov.w	r0,@(STATE_SURGE,r6)
	mov.w	r1,@(STATE_SURGE + 2,r6)
	rts

; void body_correct_surge(const body_coefficients_t *coefficients, body_state_t *state, int32_t change_mm_s_q17): the change is on the
; stack. The four quarters are added two at a time: they have one sign, so that the sum saturates the same way.
	.align 1
	.global _body_correct_surge
_body_correct_surge:
	SAVE
	mov.w	r0,r4
	mov.w	r1,r5
	mov.w	@(8,r7),r1
	mov.w	@(10,r7),r2
	mov.b	#COEFFICIENTS_QUARTER_WHEEL_FROM_SURGE,r0l
	jsr	@_scale_h8_at
	add.w	r1,r1
	rotxl	r0l
	rotxl	r0h
	PUSH32
	mov.w	r5,r2
	adds	#2,r2
	adds	#2,r2		; STATE_SPEED_0
	mov.w	r2,r6
	jsr	@_fix_add_to
	mov.w	@r7+,r0
	mov.w	@r7+,r1
	mov.w	r6,r2
	jsr	@_fix_add_to
	mov.w	#12000,r2	; MOTOR_SPEED_LIMIT_MRAD_S_Q13 / 65536
	jsr	@_fix_clamp_q16
	mov.w	r0,@r6
	mov.w	r1,@(2,r6)
	jmp	@.Lsurge
#endif
