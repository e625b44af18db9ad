; mixer_h8.S: mixer.h in the RCX's own instructions: see core/h8.inc.
	.include "core/h8.inc"
	.text

; void mixer_step(const mixer_config_t *config, mixer_state_t *state, const signals_effort_t *effort, const signals_state_t *motion):
; motion is on the stack. r4 is the drive's configuration, r5 the state, r6 the effort, then the motion. On the stack: the voltage that the
; motors may have, and the battery's.
	.align 1
	.global _mixer_step
_mixer_step:
	SAVE
	mov.w	r0,r4
	mov.w	r1,r5
	mov.w	r2,r6
	mov.w	@(10,r5),r0	; battery_mv
	mov.w	@r4+,r2		; battery_floor_mv
	cmp.w	r2,r0
	bcc	.Lnot_low
	mov.w	@(16,r5),r0	; battery_low_steps
	jsr	@_fix_count_u16
	mov.w	r0,@(16,r5)
	mov.w	r2,r0
.Lnot_low:
	mov.w	#20000,r1	; VOLTAGE_MAX_MV
	cmp.w	r1,r0
	bls	.Lnot_high
	mov.w	r1,r0
.Lnot_high:
	mov.w	r0,@-r7
	mov.w	@r4+,r1		; max_duty_q15
	mov.w	#0x7fff,r2
	cmp.w	r2,r1
	beq	.Lall_of_it
	jsr	@_fix_mul_u16
	mov.w	#0x7fff,r2
	jsr	@_fix_div_u32
	mov.w	r1,r0
.Lall_of_it:
	mov.w	r0,@-r7
	mov.w	@(20,r4),r2	; reserve_mv
	sub.w	r2,r0
	bpl	.Lavailable
	sub.w	r0,r0
.Lavailable:
	mov.w	r0,r2
	mov.w	r0,r1
	mov.w	@(2,r6),r0	; yaw_mv
	jsr	@_fix_clamp16
	mov.w	r0,r3
	jsr	@_fix_abs_u16
	sub.w	r0,r2
	mov.w	r2,r1
	mov.w	@r6,r0		; surge_mv
	jsr	@_fix_clamp16
	mov.w	r0,r1		; surge: r1, yaw: r3
	add.w	r3,r0
	mov.w	r0,@r5		; left_mv
	mov.w	r1,r0
	sub.w	r3,r0
	mov.w	r0,@(2,r5)	; right_mv
	mov.w	r3,@-r7
	mov.w	@r6,r0
	mov.w	r5,r2
	add.b	#12,r2l
	addx	#0,r2h		; surge_saturated_steps
	jsr	@_fix_excess
	mov.b	r0l,@(8,r5)	; surge_saturated
	mov.w	@r7+,r1
	mov.w	@(2,r6),r0
	mov.w	r5,r2
	add.b	#14,r2l
	addx	#0,r2h		; yaw_saturated_steps
	jsr	@_fix_excess
	mov.b	r0l,@(9,r5)	; yaw_saturated
	sub.w	r0,r0
	mov.w	r0,@(4,r5)	; left_q15
	mov.w	r0,@(6,r5)	; right_q15
	mov.w	@r5,r0
	bne	.Ldrive
	mov.w	@(2,r5),r0
	beq	.Loff
.Ldrive:
	mov.w	@(12,r7),r6
	mov.w	r4,r0
	mov.w	@(12,r6),r1	; yaw_rate_mrad_s
	jsr	@_drive_turning_mm_s_q4
	mov.w	r0,@-r7
	mov.w	@(10,r6),r1	; speed_mm_s_q4
	jsr	@_fix_add16
	mov.w	r4,r1
	bsr	.Lside
	mov.w	@(10,r6),r0
	mov.w	@r7,r1
	jsr	@_fix_sub16
	mov.w	r4,r1
	add.b	#8,r1l
	addx	#0,r1h
	bsr	.Lside
	adds	#2,r7
.Loff:
	adds	#2,r7
	adds	#2,r7
.Lrestore:
	mov.w	@r7+,r6
	mov.w	@r7+,r5
	mov.w	@r7+,r4
	rts

; void mixer_correct(const mixer_config_t *config, mixer_state_t *state, uint16_t battery_mv): r4 walks along the voltages, r5 is what
; the battery has more.
	.align 1
	.global _mixer_correct
_mixer_correct:
	SAVE
	mov.w	r1,r4
	mov.w	@r0,r0		; battery_floor_mv
	mov.w	@(10,r4),r1	; battery_mv
	cmp.w	r0,r1
	bcc	.Lbelieved
	mov.w	r0,r1
.Lbelieved:
	sub.w	r1,r2
	mov.w	r2,r5
	bsr	.Lcorrect
	bsr	.Lcorrect
	bra	.Lrestore
.Lcorrect:
	mov.w	r5,r0
	mov.w	@(4,r4),r1	; left_q15, right_q15
	jsr	@_fix_share16_q15
	mov.w	@r4,r1		; left_mv, right_mv
	jsr	@_fix_add16
	mov.w	r0,@r4
	adds	#2,r4
	rts

; One side, of speed r0 and configuration r1: its duty, as r5 points to its voltage; r5 moves on to the other one's. On the stack: the
; return, what turning adds, the voltage that motors may have, the battery's.
.Lside:
	mov.w	r0,@-r7
	mov.w	r4,r0
	mov.w	@r5,r2
	jsr	@_drive_voltage_mv
	adds	#2,r7
	mov.w	@(4,r7),r1
	jsr	@_fix_clamp16
	mov.w	r0,@-r7
	jsr	@_fix_abs_u16
	mov.w	r0,r2
	sub.w	r1,r1
	shlr	r0h
	rotxr	r0l
	rotxr	r1h
	sub.w	r2,r1
	subx	#0,r0l
	subx	#0,r0h		; 32767 of the magnitude
	mov.w	@(8,r7),r2
	mov.w	r2,r3
	shlr	r3h
	rotxr	r3l
	add.w	r3,r1
	addx	#0,r0l
	addx	#0,r0h
	jsr	@_fix_div_u32
	mov.w	@r7+,r2
	bpl	.Lforward
	not	r1h
	not	r1l
	adds	#1,r1
.Lforward:
	mov.w	r1,@(4,r5)
	adds	#2,r5
	rts
