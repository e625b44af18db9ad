; speed_h8.S: speed.h in the RCX's own instructions: see core/h8.inc.
#define H8_ASSEMBLY
	.include "core/h8.inc"
#include "estimator/speed_h8.h"
	.text

; r0:r1 of a place in the struct at a register, and back.
	.macro	LOAD	place, at
	mov.w	@(\place,\at),r0
	mov.w	@(\place + 2,\at),r1
	.endm
	.macro	STORE	place, at
	mov.w	r0,@(\place,\at)
	mov.w	r1,@(\place + 2,\at)
	.endm

; The travel at two speeds' mean, r0 and r1, to a place in the signals.
	.macro	TRAVEL	place
	sub.b	r3l,r3l
	add.w	r1,r0
	bge	.Lsum\@
	dec	r3l
.Lsum\@:
	mov.w	r0,r1
	mov.b	r3l,r0l
	mov.b	r3l,r0h
	mov.b	@(SIGNALS_PERIOD_MS,r6),r2l
	jsr	@_fix_times
	STORE	\place,r6
	.endm

; int32_t speed_step(const speed_config_t *config, speed_state_t *state, signals_state_t *signals): r4, r5 and r6. On the stack is the speed
; observed; where there can be a reference, above it the speed of the step before.
	.align 1
	.global _speed_step
_speed_step:
	SAVE
	mov.w	r0,r4
	mov.w	r1,r5
	mov.w	r2,r6
#if SENSORS_POSSIBLE & SENSOR_REFERENCE
	mov.w	@(SIGNALS_SPEED,r6),r1
	mov.w	r1,@-r7
#endif
	mov.w	@(SIGNALS_PREDICTED,r6),r3
	mov.w	@r3+,r0		; MOTION_SURGE
	mov.w	@r3,r1
	PUSH32
	mov.b	#13,r2l
	jsr	@_fix_round16
	mov.w	@(SIGNALS_SPEED,r6),r1
	TRAVEL	SIGNALS_TRAVEL

#if SENSORS_POSSIBLE & SENSOR_ACCELEROMETER
	mov.b	@(SIGNALS_HAVE_BITS,r6),r2l
	btst	#ACCELEROMETER_PLACE,r2l
	beq	.Lnot_felt
	mov.b	@(SIGNALS_AT_REST,r6),r2l
	bne	.Llearn
	jsr	@.Lobserve_accel
	bra	.Lnot_felt
.Llearn:
	mov.w	#0x8000,r2	; BIAS_LIMIT_MM_S2_Q12, 0x3e8000
	mov.w	r2,@-r7
	mov.w	#0x3e,r2
	mov.w	r2,@-r7
	mov.b	@(CONFIG_SLOWEST_WEIGHT_BITS,r4),r2l
	mov.w	r2,@-r7
	mov.w	@(SIGNALS_ACCEL_SURGE,r6),r0
	jsr	@_fix_q8
	mov.b	#16,r2l		; q12
	jsr	@_fix_times
	mov.w	r1,r2
	mov.w	r0,r1
	mov.w	r5,r0
	add.b	#STATE_BIAS,r0l
	addx	#0,r0h
	jsr	@_bias_learn
	adds	#2,r7
	adds	#2,r7
	adds	#2,r7
.Lnot_felt:
#endif

#if SENSORS_POSSIBLE & SENSOR_ROTATION
	mov.b	@(SIGNALS_HAVE_BITS,r6),r2l
	btst	#ROTATION_PLACE,r2l
	bne	.Lcount
	jmp	@.Lnot_counted
.Lcount:
	mov.w	@(SIGNALS_ROTATION_LEFT,r6),r0
	mov.w	@(STATE_ROTATION_LEFT,r5),r2
	mov.w	r0,@(STATE_ROTATION_LEFT,r5)
	sub.w	r2,r0
	mov.w	@(SIGNALS_ROTATION_RIGHT,r6),r1
	mov.w	@(STATE_ROTATION_RIGHT,r5),r2
	mov.w	r1,@(STATE_ROTATION_RIGHT,r5)
	sub.w	r2,r1
	mov.b	@(STATE_ROTATION_KNOWN,r5),r2l
	bne	.Lknown
	mov.b	#1,r2l
	mov.b	r2l,@(STATE_ROTATION_KNOWN,r5)
	sub.w	r0,r0
	sub.w	r1,r1
	bra	.Lcounted
.Lknown:
	PUSH32
	jsr	@_fix_add16
	jsr	@.Ltravel_of_counts
	mov.w	@r7+,r2
	mov.w	@r7+,r3
	PUSH32			; the mean's
	mov.w	r2,r0
	mov.w	r3,r1
	jsr	@_fix_sub16
	jsr	@.Ltravel_of_counts
	mov.w	@(CONFIG_COUNT_MISMATCH,r4),r2
	jsr	@_fix_share_q15
	mov.w	@r7+,r2
	mov.w	@r7+,r3
	ADD32
	mov.w	#16384,r2	; MOST_TRAVEL_UM_Q_11
	jsr	@_fix_clamp_q16
.Lcounted:
	mov.w	@(STATE_BEHIND,r5),r2
	mov.w	@(STATE_BEHIND + 2,r5),r3
	ADD32
	mov.w	@(SIGNALS_TRAVEL,r6),r2
	mov.w	@(SIGNALS_TRAVEL + 2,r6),r3
	SUB32
	PUSH32			; how far behind
	mov.w	@(CONFIG_BEHIND_TO_TRAVEL,r4),r2
	jsr	@_fix_share_q15
	mov.w	@(SIGNALS_TRAVEL,r6),r2
	mov.w	@(SIGNALS_TRAVEL + 2,r6),r3
	add.w	r1,r3
	addx	r0l,r2l
	addx	r0h,r2h
	mov.w	r2,@(SIGNALS_TRAVEL,r6)
	mov.w	r3,@(SIGNALS_TRAVEL + 2,r6)
	mov.w	@r7+,r2
	mov.w	@r7+,r3
	sub.w	r1,r3
	subx	r0l,r2l
	subx	r0h,r2h
	mov.w	r2,r0
	mov.w	r3,r1
	mov.w	#0xd400,r3	; SPEED_BEHIND_LIMIT_UM_Q5, 0x30d400
	mov.w	r3,@-r7
	mov.w	#0x30,r3
	mov.w	r3,@-r7
	jsr	@_fix_clamp32
	adds	#2,r7
	adds	#2,r7
	STORE	STATE_BEHIND,r5
	mov.w	@(CONFIG_BEHIND_TO_SPEED,r4),r2
	jsr	@_fix_share_q15
	mov.w	@r7+,r2
	mov.w	@r7+,r3
	ADD32
	PUSH32
.Lnot_counted:
#endif

	mov.b	@(SIGNALS_AT_REST,r6),r2l
	beq	.Lmoving
	sub.w	r0,r0
	sub.w	r1,r1
	mov.w	r0,@r7
	mov.w	r0,@(2,r7)
	STORE	SIGNALS_TRAVEL,r6
#if SENSORS_POSSIBLE & SENSOR_ROTATION
	STORE	STATE_BEHIND,r5
#endif
.Lmoving:
#if SENSORS_POSSIBLE & SENSOR_REFERENCE
	mov.b	@(SIGNALS_HAVE_BITS,r6),r2l
	btst	#REFERENCE_PLACE,r2l
	beq	.Lobserved
	mov.w	@(SIGNALS_REFERENCE_SPEED,r6),r0
	jsr	@_fix_q8
	mov.b	#32,r2l		; q4 to q17
	jsr	@_fix_times
	mov.w	r0,@r7
	mov.w	r1,@(2,r7)
.Lobserved:
#endif

	mov.w	@r7+,r0
	mov.w	@r7+,r1
	mov.w	#16380,r2	; SPEED_LIMIT_MM_S_Q1
	jsr	@_fix_clamp_q16
	mov.w	@r5,r2		; STATE_SPEED: both are within the limit, so that nothing saturates
	mov.w	@(2,r5),r3
	mov.w	r0,@r5
	mov.w	r1,@(2,r5)
	SUB32
	PUSH32			; the jump
	mov.w	@r5,r0
	mov.w	@(2,r5),r1
	mov.b	#13,r2l
	jsr	@_fix_round16
	mov.w	r0,@(SIGNALS_SPEED,r6)
	mov.b	@(SIGNALS_PERIOD_MS,r6),r0l
	jsr	@_fix_inverse_q15
	mov.w	r0,r3
	mov.w	@r7+,r0
	mov.w	@r7+,r1
	mov.w	#8192,r2	; JUMP_LIMIT_MM_S_Q1
	jsr	@_fix_clamp_q16
	mov.w	r3,r2
	jsr	@_fix_share_q15
	mov.w	#32000,r2	; MM_S2_Q8_PER_Q17_MS_Q14
	jsr	@_fix_share_q15
	add.w	r1,r1
	rotxl	r0l
	rotxl	r0h
	mov.w	r5,r2
	adds	#2,r2
	adds	#2,r2		; STATE_ACCEL
	mov.w	r2,@-r7
	jsr	@_fix_less
	mov.w	@(CONFIG_ACCEL_FILTER,r4),r2
	jsr	@_fix_share_q15
	mov.w	@r7+,r2
	jsr	@_fix_add_to
	mov.b	#8,r2l
	jsr	@_fix_round16
	mov.w	r0,@(SIGNALS_ACCEL,r6)

#if SENSORS_POSSIBLE & SENSOR_REFERENCE
	mov.w	@r7+,r1
	mov.b	@(SIGNALS_HAVE_BITS,r6),r2l
	btst	#REFERENCE_PLACE,r2l
	beq	.Lno_reference
	mov.w	@(SIGNALS_SPEED,r6),r0
	TRAVEL	SIGNALS_TRAVEL
.Lno_reference:
#endif
#ifndef BODY_WITHOUT_PAPER
	jsr	@.Lsway
	mov.w	@(STATE_SWAY,r5),r1
	mov.w	r0,@(STATE_SWAY,r5)
	TRAVEL	SIGNALS_SWAY_TRAVEL
#endif
	mov.w	@(SIGNALS_PREDICTED,r6),r2
	mov.w	@r5,r0
	mov.w	@(2,r5),r1
	jsr	@_fix_less
	LEAVE

#if SENSORS_POSSIBLE & SENSOR_ACCELEROMETER
; The accelerometer's word on the speed observed, which is above the return address.
.Lobserve_accel:
	LOAD	2,r7
	mov.w	r5,r2		; STATE_SPEED
	jsr	@_fix_less
	PUSH32			; the change predicted
	LOAD	STATE_BIAS,r5
	mov.b	#12,r2l
	jsr	@_fix_round16
#ifdef BODY_WITHOUT_PAPER
	mov.w	r0,r1
	mov.w	@(SIGNALS_ACCEL_SURGE,r6),r0
	jsr	@_fix_sub16
#else
	mov.w	r0,@-r7
	jsr	@.Lsway
	mov.w	@(SIGNALS_YAW_RATE,r6),r1
	jsr	@_fix_mul
	mov.w	#16777,r2	; PER_1000_Q24
	jsr	@_fix_share_q15
	mov.b	#13,r2l
	jsr	@_fix_round16
	mov.w	@r7+,r2
	mov.w	@(SIGNALS_ACCEL_SURGE,r6),r3
	mov.w	r0,r1
	bsr	.Lextend
	bsr	.Ladd16
	mov.w	r2,r3
	not	r3h
	not	r3l
	adds	#1,r3
	bsr	.Ladd16
	jsr	@_fix_sat16
#endif
	jsr	@_fix_q8
	mov.b	@(SIGNALS_PERIOD_MS,r6),r2l
	jsr	@_fix_times
	mov.w	#16777,r2	; Q17_PER_UM_S_Q8_Q15
	jsr	@_fix_share_q15
	mov.w	r7,r2
	jsr	@_fix_less
	mov.w	@r4,r2		; CONFIG_ACCEL_GAIN
	jsr	@_fix_share_q15
	adds	#2,r7
	adds	#2,r7
	mov.w	r7,r2
	adds	#2,r2
	jmp	@_fix_add_to
#endif

#ifndef BODY_WITHOUT_PAPER
; The sway, mm/s q4, to r0.
.Lsway:
	mov.w	@(SIGNALS_PREDICTED,r6),r2
	LOAD	MOTION_SWAY,r2
	mov.b	#13,r2l
	jmp	@_fix_round16

; r0:r1 is r1; and r3, above -32768, more. Uses r3.
.Lextend:
	sub.w	r0,r0
	mov.w	r1,r1
	bpl	.Lextended
	subs	#1,r0
.Lextended:
	rts
.Ladd16:
	add.w	r3,r1
	addx	#0,r0l
	addx	#0,r0h
	mov.w	r3,r3
	bpl	.Ladded
	subs	#1,r0
.Ladded:
	rts
#endif

#if SENSORS_POSSIBLE & SENSOR_ROTATION
; Of r0 counts, at most MOST_COUNTS, to r0:r1: a negative number's product without sign is 65536 times the travel of a count too large.
.Ltravel_of_counts:
	mov.w	#4096,r1
	jsr	@_fix_clamp16
	add.w	r0,r0
	add.w	r0,r0
	mov.w	r0,@-r7
	mov.w	@(CONFIG_COUNT_TRAVEL,r4),r1
	jsr	@_fix_mul_u16
	mov.w	@r7+,r2
	bpl	.Lforward
	mov.w	@(CONFIG_COUNT_TRAVEL,r4),r2
	sub.w	r2,r0
.Lforward:
	rts
#endif
