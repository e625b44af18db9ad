; motor.S: motor.h in the RCX's own instructions: see core/h8/macros.inc.
#include "core/h8/layout.h"
#include "model/limits.h"
	.include "core/h8/macros.inc"
	.text

#if ROW_FROM_CURRENT != 0 || ROW_FROM_SPEED != 4 || ROW_FROM_VOLTAGE != 8 || SCALE_SHIFT != 2
#error "motor_step walks along the scales of a row, 4 bytes each: current, speed, voltage"
#endif
#if MOTOR_COEFFICIENTS_CURRENT != 0 || MOTOR_CURRENT != 0 || MOTOR_SPEED != 4
#error "motor_step walks along the state: current, then speed"
#endif

; void motor_step(const motor_coefficients_t *coefficients, motor_state_t *state, int16_t voltage_mv, int32_t load_mrad_s_q13)
; The load is on the stack. One value after the other goes into the sums of both rows. The stack then holds, a word each: the
; state; the row of the current: its scale, sum (2); the voltage; the row of the speed: its scale, sum (2).
	.align 1
	.global _motor_step
_motor_step:
	jsr	@_begin_saved
	mov.w	@(8,r7),r4
	mov.w	@(10,r7),r3
	mov.w	r3,@-r7
	mov.w	r4,@-r7
	mov.w	r0,r3
	add.b	#MOTOR_COEFFICIENTS_SPEED,r3l
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
	mov.w	#MOTOR_SPEED_LIMIT_MRAD_S_Q13_HIGH,r2
	jsr	@_fix_clamp_q16
	mov.w	r0,@r4
	mov.w	r1,@(2,r4)
	LEAVE

; Inner routine: adds the value at r1 by both scales to both sums, which are 2 bytes higher up the stack than above. The
; value is doubled, as |mantissa| is not: see scale.h. For the voltage the place of its word makes up for that.
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

; Inner routine: the same of the magnitude r5:r2, with the sign of r4l. The row of the current comes first; its place is 8
; bytes below that of the speed, as the stack is lower by the 8 bytes of a call and three words.
.Lboth:
	mov.w	r2,@-r7
	mov.w	r5,@-r7
	mov.w	r4,@-r7
	bsr	.Lone
	mov.w	@r7+,r4
	mov.w	@r7+,r5
	mov.w	@r7+,r2

; Inner routine: the same for one row, whose scale is 12 bytes up the stack.
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
	jsr	@_fix_inner_multiply
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
