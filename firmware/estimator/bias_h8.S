; bias_h8.S: bias.h in the RCX's own instructions: see core/h8.inc.
	.include "core/h8.inc"
	.text

; void bias_learn(bias_t *bias, int32_t sample, uint8_t slowest_weight_bits, int32_t limit): the last two are on the stack.
	.align 1
	.global _bias_learn
_bias_learn:
	mov.w	r4,@-r7
	mov.w	r0,r4
	mov.w	r1,r0
	mov.w	r2,r1
	mov.w	r4,r2
	jsr	@_fix_less
	PUSH32
	mov.w	@(4,r4),r0
	mov.w	@(8,r7),r1
	jsr	@_fix_bits
	mov.b	r0l,r2l
	mov.w	@r7+,r0
	mov.w	@r7+,r1
	jsr	@_fix_fraction
	mov.w	r4,r2
	jsr	@_fix_add_to
	mov.w	@(8,r7),r3
	mov.w	@(6,r7),r2
	mov.w	r3,@-r7
	mov.w	r2,@-r7
	jsr	@_fix_clamp32
	adds	#2,r7
	adds	#2,r7
	mov.w	r0,@r4
	mov.w	r1,@(2,r4)
	mov.w	@(4,r4),r0
	jsr	@_fix_count_u16
	mov.w	r0,@(4,r4)
	mov.w	@r7+,r4
	rts
