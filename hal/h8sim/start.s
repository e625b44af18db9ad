; Start and the two system calls of gdb's H8/300 simulator: a JSR to a magic address, written out since -relax would turn it
; into a BSR. Arguments come in the registers where the compiler puts them: r0 what, r1 buffer, r2 size; the result in r0.
	.section .text
	.global _start
_start:
	mov.w	#_stack,r7
	jsr	@_main
	mov.b	r0l,r0h		; the status, in the high byte
	sub.b	r0l,r0l
	mov.w	#0xdead,r1	; with these a sleep is the end
	mov.w	#0xbeef,r2
	sleep

	.global _h8sim_read
_h8sim_read:
	.word	0x5e00,0x00c6
	rts

	.global _h8sim_write
_h8sim_write:
	.word	0x5e00,0x00c7
	rts
