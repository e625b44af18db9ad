; What of LEGO's ROM alone.c cannot say in C.
	.section .text

; The timer's interrupt that switches tasks, by the ROM: other tasks may run before it returns.
	.global _alone_switch_tasks
_alone_switch_tasks:
	stc	ccr,r1h
	push	r1
	jmp	@_rom_ocia_handler

; In place of drawing on the display, from which the task that asked for it never returns: the world, on a stack of its own.
	.global _alone_begin
_alone_begin:
	mov.w	#stack_end,r7
	jmp	@_alone_world

; r5 and r6, 32 bits, times r3 and r4. What the kernel measures the battery with; r0 to r4 may be lost.
	.global _rom_multiply
_rom_multiply:
	sub.w	r0,r0
	sub.w	r1,r1
	mov.b	#32,r2l
1:	shlr	r3h
	rotxr	r3l
	rotxr	r4h
	rotxr	r4l
	bcc	2f
	add.w	r6,r1
	addx	r5l,r0l
	addx	r5h,r0h
2:	add.w	r6,r6
	rotxl	r5l
	rotxl	r5h
	dec	r2l
	bne	1b
	mov.w	r1,r6
	mov.w	r0,r5
	rts

; The same divided; neither is negative.
	.global _rom_divide
_rom_divide:
	sub.w	r0,r0
	sub.w	r1,r1
	mov.b	#32,r2l
1:	add.w	r6,r6
	rotxl	r5l
	rotxl	r5h
	rotxl	r1l
	rotxl	r1h
	rotxl	r0l
	rotxl	r0h
	sub.w	r4,r1
	subx	r3l,r0l
	subx	r3h,r0h
	bcc	2f
	add.w	r4,r1
	addx	r3l,r0l
	addx	r3h,r0h
	bra	3f
2:	bset	#0,r6l
3:	dec	r2l
	bne	1b
	rts

	.section .bss
	.space	512
stack_end:
