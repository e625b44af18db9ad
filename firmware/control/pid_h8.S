; pid_h8.S: pid.h in the RCX's own instructions: see core/h8.inc.
	.include "core/h8.inc"
	.text

; r0, with its sign, more: r3:r1. Uses r2l.
	.macro	ADD_SIGNED
	bld	#7,r0h
	subx	r2l,r2l
	add.w	r0,r1
	addx	r2l,r3l
	addx	r2l,r3h
	.endm

; void pid_stop(pid_state_t *state, pid_terms_t *terms): the integral, and the ten bytes of the answer
	.align 1
	.global _pid_stop
_pid_stop:
	sub.w	r2,r2
	mov.w	r2,@r0
	mov.w	r2,@(2,r0)
	add.b	#18,r1l
	addx	#0,r1h
	.rept	5
	mov.w	r2,@-r1
	.endr
	rts

; void pid_step(const pid_config_t *config, pid_state_t *state, pid_terms_t *terms): r4, r5 and r6 walk along them, as the structs are
; laid out: in the order of use.
	.align 1
	.global _pid_step
_pid_step:
	SAVE
	mov.w	r0,r4
	mov.w	r1,r5
	mov.w	r2,r6
	mov.w	@r5+,r0
	mov.w	@r5+,r1
	jsr	@_fix_round_bam16	; what it does to a heading it does to a number with a sign
	mov.w	r0,@(14,r6)	; integral_mv
	mov.w	@r4+,r0		; kd_mv_q10
	mov.w	@r6+,r1		; rate
	jsr	@_fix_gain16_q10
	not	r0h
	not	r0l
	adds	#1,r0
	mov.w	r0,@(14,r6)	; derivative_mv
	mov.w	r1,@-r7
	mov.w	r3,@-r7
	mov.w	@r4+,r0		; kp_mv_q10
	mov.w	@r6+,r1		; error
	jsr	@_fix_gain16_q10
	mov.w	r0,@(8,r6)	; proportional_mv
	mov.w	@r7+,r2
	mov.w	@r7+,r0
	sub.w	r0,r1
	subx	r2l,r3l
	subx	r2h,r3h
	mov.w	@r6+,r0		; feedforward_mv
	ADD_SIGNED
	mov.w	@(8,r6),r0	; integral_mv
	ADD_SIGNED
	mov.w	r3,r0
	jsr	@_fix_sat16
	mov.w	r0,@-r7		; what is asked for
	mov.w	@(2,r4),r1	; limit_mv
	jsr	@_fix_clamp16
	mov.w	r0,@(4,r6)	; output_mv
	mov.w	r0,r1
	mov.w	@r7+,r0
	mov.w	r5,r2		; limited_steps
	jsr	@_fix_excess
	mov.b	r0l,@(2,r6)	; limited

	mov.w	@r4+,r0		; ki_mv_q10
	mov.w	@(-4,r6),r1	; error
	jsr	@_fix_mul
	mov.b	@(1,r6),r3l	; period_ms, and its factor_q14()
	mov.b	#20,r3h
	cmp.b	r3h,r3l
	bls	.Lperiod
	mov.b	r3h,r3l
.Lperiod:
	mov.b	#131,r2l
	mulxu.b	r3l,r2
	add.w	r2,r2
	add.w	r2,r2
	add.w	r2,r2
	mov.b	#160,r3h
	mulxu.b	r3h,r3
	add.b	#128,r3l
	addx	#0,r3h
	add.b	r3h,r2l
	addx	#0,r2h
	jsr	@_fix_share_q16
	.rept	2
	add.w	r1,r1
	rotxl	r0l
	rotxl	r0h
	.endr
	mov.b	r0h,r2l
	or	r0l,r2l
	or	r1h,r2l
	or	r1l,r2l
	beq	.Ladvance
	bld	#7,r0h
	subx	r3l,r3l
	or	#1,r3l		; the direction
	mov.b	@(2,r6),r3h	; limited
	cmp.b	r3l,r3h
	beq	.Lheld
	mov.b	@r6,r3h		; saturated
	cmp.b	r3l,r3h
	bne	.Ladvance
.Lheld:
	mov.w	@(2,r5),r0	; held_steps
	jsr	@_fix_count_u16
	mov.w	r0,@(2,r5)
	bra	.Lend
.Ladvance:
	subs	#2,r5
	subs	#2,r5
	mov.w	r5,r2
	jsr	@_fix_add_to
	mov.w	@r4,r2		; limit_mv
	jsr	@_fix_clamp_q16
	mov.w	r0,@r5
	mov.w	r1,@(2,r5)
.Lend:
	mov.w	@r7+,r6
	mov.w	@r7+,r5
	mov.w	@r7+,r4
	rts
