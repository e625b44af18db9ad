; frames.S: how functions begin and end that the compiler made. hal/h8/shared_parts.awk makes them jump here. These are
; not C functions.
	.text

; Saves r4 to r6 below r3l bytes of locals (2 to 254, even). Uses r3. The caller's return address becomes the highest two
; bytes of the locals.
	.align 1
	.global _begin_saved_framed
_begin_saved_framed:
	sub.b	r3h,r3h
	sub.w	r3,r7
	mov.w	r4,@r7
	mov.w	r7,r4
	add.w	r3,r4
	mov.w	@r4,r4		; where to go on
	mov.w	r5,@-r7
	mov.w	r6,@-r7
	jmp	@r4

; Saves r4 to r6. Uses r3.
	.align 1
	.global _begin_saved
_begin_saved:
	mov.w	@r7+,r3
	mov.w	r4,@-r7
	mov.w	r5,@-r7
	mov.w	r6,@-r7
	jmp	@r3

; Restores r4 to r6, removes r2l bytes of locals and returns. Uses r2.
	.align 1
	.global _end_saved_framed
_end_saved_framed:
	mov.w	@r7+,r6
	mov.w	@r7+,r5
	mov.w	@r7+,r4
	sub.b	r2h,r2h
	add.w	r2,r7
	rts

; Restores r4 to r6 and returns.
	.align 1
	.global _end_saved
_end_saved:
	mov.w	@r7+,r6
	mov.w	@r7+,r5
	mov.w	@r7+,r4
	rts

; Restores r4 and r5 and returns.
	.align 1
	.global _end_two_saved
_end_two_saved:
	mov.w	@r7+,r5
	mov.w	@r7+,r4
	rts
