; Start on gdb's H8/300 simulator, beside brickOS's kernel; and the way out.
	.section .text
	.global _start
_start:
	mov.w	#0xfe00,r7
	jmp	@_world_boot

	.global _world_exit
_world_exit:
	mov.b	r0l,r0h		; the status, in the high byte
	sub.b	r0l,r0l
	mov.w	#0xdead,r1	; with these a sleep is the end
	mov.w	#0xbeef,r2
	sleep

	.global _world_read
_world_read:
	.word	0x5e00,0x00c6	; the simulator's system calls: r0 descriptor, r1 bytes, r2 size
	rts

	.global _world_write
_world_write:
	.word	0x5e00,0x00c7
	rts

; An interrupt, as LEGO's ROM hands it on: r6 is saved, the handler's address is in r0.
	.global _world_interrupt
_world_interrupt:
	mov.w	r6,@-r7
	jsr	@r0
	mov.w	@r7+,r6
	rts
