; drive_h8.S: drive.h in the RCX's own instructions: see core/h8.inc.
	.include "core/h8.inc"
	.text

; int16_t drive_turning_mm_s_q4(const drive_config_t *config, int16_t yaw_rate_mrad_s)
	.align 1
	.global _drive_turning_mm_s_q4
_drive_turning_mm_s_q4:
	mov.w	@(18,r0),r0	; half_track_m_q14
	beq	.Lno_turning
	jsr	@_fix_mul
	mov.b	#10,r2l
	jsr	@_fix_fraction
	jmp	@_fix_sat16
.Lno_turning:
	rts

; int16_t drive_voltage_mv(const drive_config_t *config, const drive_side_t *side, int16_t wanted_mv, int16_t speed_mm_s_q4): the speed
; is on the stack. r5 walks along the side, as it is laid out: in the order of use. r6 is the voltage wanted, then what there is of the sum.
	.align 1
	.global _drive_voltage_mv
_drive_voltage_mv:
	SAVE
	mov.w	r0,r4
	mov.w	r1,r5
	mov.w	r2,r6
	mov.w	@(8,r7),r0
	mov.w	@r5+,r1		; emf_mv_q15
	jsr	@_fix_share16_q15
	mov.w	r6,r1
	jsr	@_fix_add16
	mov.w	@r5+,r1		; offset_mv
	jsr	@_fix_add16
	mov.w	r0,@-r7
	mov.w	@(10,r7),r0
	jsr	@_fix_abs_u16
	mov.w	#160,r1		; DRIVE_STILL_MM_S_Q4
	cmp.w	r1,r0
	bcs	.Lstill
	mov.w	#2047,r6	; FULL_FROM_MV
	mov.w	@(10,r7),r0
	bpl	.Lstill
	mov.w	#-2047,r6
.Lstill:
	mov.w	r6,r0
	mov.w	@r5+,r1		; friction_mv
	bsr	.Lalong
	mov.w	@r7+,r1
	jsr	@_fix_add16
	mov.w	r0,r6
	mov.w	@r5,r1		; gain_q15
	jsr	@_fix_share16_q15
	mov.w	r6,r1
	jsr	@_fix_add16
	mov.w	r0,r6
	mov.w	@(16,r4),r1	; deadband_mv
	bsr	.Lalong
	mov.w	r6,r1
	jsr	@_fix_add16
	mov.w	@r7+,r6
	mov.w	@r7+,r5
	mov.w	@r7+,r4
	rts

; along(r0, r1)
.Lalong:
	mov.w	r1,r2
	beq	.Lof_no_size
	mov.w	#2047,r1
	jsr	@_fix_clamp16
	add.w	r0,r0
	add.w	r0,r0
	add.w	r0,r0
	add.w	r0,r0
	mov.w	r2,r1
	jmp	@_fix_clamp16
.Lof_no_size:
	mov.w	r2,r0
	rts
