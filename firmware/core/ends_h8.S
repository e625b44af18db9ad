; ends_h8.S: how functions end that the compiler made: hal/h8/shared_ends.awk has them jump here. Not C functions.
	.text

; Registers, then r2l bytes of locals (2 to 254, even).
	.align 1
	.global _end_saved_framed
_end_saved_framed:
	mov.w	@r7+,r6
	mov.w	@r7+,r5
	mov.w	@r7+,r4
	sub.b	r2h,r2h
	add.w	r2,r7
	rts

	.align 1
	.global _end_saved
_end_saved:
	mov.w	@r7+,r6
	.global _end_two_saved
_end_two_saved:
	mov.w	@r7+,r5
	mov.w	@r7+,r4
	rts
