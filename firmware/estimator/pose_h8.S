; pose_h8.S: pose.h in the RCX's own instructions: see core/h8.inc.
#define H8_ASSEMBLY
	.include "core/h8.inc"
#include "estimator/pose_h8.h"
	.text

; void pose_step(pose_state_t *state, signals_state_t *signals): r4, which moves on to the rest of the next axis, and r5.
	.align 1
	.global _pose_step
_pose_step:
	SAVE
	mov.w	r0,r4
	mov.w	r1,r5
	mov.w	@(SIGNALS_HEADING,r5),r0
	mov.w	@(POSE_HEADING,r4),r1
	mov.w	r0,@(POSE_HEADING,r4)
	sub.w	r1,r0
	bpl	.Lto_the_right
	adds	#1,r0		; half of it, towards 0
.Lto_the_right:
	shar	r0h
	rotxr	r0l
	add.w	r1,r0
	mov.w	r0,r6
	jsr	@_trig_cos_q15
	mov.w	r0,@-r7
	mov.w	r6,r0
	jsr	@_trig_sin_q15
	mov.w	r0,r6
	mov.w	@r7+,r2
#ifndef BODY_WITHOUT_PAPER
	mov.w	r2,@-r7
	jsr	@.Lnegative
#endif
	bsr	.Laxis
	mov.w	r5,r2
	jsr	@_fix_add_to
#ifndef BODY_WITHOUT_PAPER
	jsr	@.Lnegative
	mov.w	r6,r2
	mov.w	@r7+,r6
#else
	mov.w	r6,r2
#endif
	bsr	.Laxis
	mov.w	r5,r2
	adds	#2,r2
	adds	#2,r2		; SIGNALS_Y_UM
	jsr	@_fix_add_to
#if SENSORS_POSSIBLE & SENSOR_REFERENCE
	mov.b	@(SIGNALS_HAVE_BITS,r5),r2l
	btst	#REFERENCE_PLACE,r2l
	beq	.Lreckoned
	sub.w	r2,r2
	mov.w	r2,@-r4
	mov.w	r2,@-r4
	mov.w	@(SIGNALS_REFERENCE_X,r5),r2
	mov.w	r2,@(SIGNALS_X_UM,r5)
	mov.w	@(SIGNALS_REFERENCE_X + 2,r5),r2
	mov.w	r2,@(SIGNALS_X_UM + 2,r5)
	mov.w	@(SIGNALS_REFERENCE_Y,r5),r2
	mov.w	r2,@(SIGNALS_Y_UM,r5)
	mov.w	@(SIGNALS_REFERENCE_Y + 2,r5),r2
	mov.w	r2,@(SIGNALS_Y_UM + 2,r5)
.Lreckoned:
#endif
	LEAVE

; What the travel's share r2 (and the sway's, r6) is on an axis, with the rest at r4: whole um to r0:r1, a new rest to r4.
.Laxis:
	mov.w	@(SIGNALS_TRAVEL,r5),r0
	mov.w	@(SIGNALS_TRAVEL + 2,r5),r1
	jsr	@_fix_share_q15
#ifndef BODY_WITHOUT_PAPER
	PUSH32
	mov.w	@(SIGNALS_SWAY_TRAVEL,r5),r0
	mov.w	@(SIGNALS_SWAY_TRAVEL + 2,r5),r1
	mov.w	r6,r2
	jsr	@_fix_share_q15
	mov.w	@r7+,r2
	mov.w	@r7+,r3
	ADD32
#endif
	mov.w	@r4,r2
	mov.b	r2h,r3l
	add.b	r3l,r3l
	subx	r3l,r3l
	add.w	r2,r1
	addx	r3l,r0l
	addx	r3l,r0h		; the sum
	bpl	.Lforward
	mov.b	#31,r3l		; to be cut towards 0
	add.b	r3l,r1l
	addx	#0,r1h
	addx	#0,r0l
	addx	#0,r0h
	bra	.Lcut
.Lforward:
	sub.b	r3l,r3l
.Lcut:
	mov.b	r1l,r2l
	and	#31,r2l
	sub.b	r3l,r2l
	subx	r2h,r2h
	mov.w	r2,@r4
	adds	#2,r4
	.rept	3		; / 2^5 is * 2^3, a byte lower: there is room for travels of 2^27
	add.w	r1,r1
	rotxl	r0l
	rotxl	r0h
	.endr
	mov.b	r1h,r1l
	mov.b	r0l,r1h
	mov.b	r0h,r0l
	add.b	r0h,r0h
	subx	r0h,r0h
	rts

#ifndef BODY_WITHOUT_PAPER
.Lnegative:
	not	r6h
	not	r6l
	adds	#1,r6
	rts
#endif
