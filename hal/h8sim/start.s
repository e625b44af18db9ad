; The start of the program, and the two system calls of gdb's H8/300 simulator. A system call is a JSR to a magic address; it is
; written as numbers, since -relax would turn a JSR into a BSR. The arguments are in the registers where the compiler puts them:
; r0 file, r1 buffer, r2 size. The result is in r0.
	.section .text
	.global _start
_start:
	mov.w	#_stack,r7
	jsr	@_main
	mov.b	r0l,r0h		; the exit status, in the high byte
	sub.b	r0l,r0l
	mov.w	#0xdead,r1	; with these numbers a sleep ends the simulator
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
