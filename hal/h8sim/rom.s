; rom.s: in place of LEGO's ROM, which nobody may distribute: what brickOS calls of it, at the same addresses. The routines are written
; anew from what brickOS expects. Those that draw on the display or set up the power do nothing. Where the ROM would switch the brick off
; or erase the kernel, the simulator ends.
;
; An interrupt comes to the ROM first. It saves r6 and calls the handler that stands in a table in RAM.
KMAIN = 0x801a

	.section .text
	.global _reset
	.org 0x0000
	.word	_reset
	.org 0x0006
	.word	nmi, dummy, dummy, dummy
	.org 0x0020
	.word	ocia, ocib
	.org 0x0036
	.word	eri, rxi, txi, tei
	.org 0x0046
	.word	ad
	.org 0x0054
	.word	multiply
	.org 0x0058
	.word	divide

; As after the download of the firmware.
	.org 0x03ae
_reset:
	mov.w	@begun,r0
	bne	over
	mov.w	#1,r0
	mov.w	r0,@begun
	mov.w	#0xff7e,r7
	andc	#0x7f,ccr
	mov.w	#KMAIN,r0
	jmp	@r0
over:
	mov.w	#0xdead,r1
	mov.w	#0xbeef,r2
	sub.w	r0,r0
	sleep

	.org 0x046a
dummy:
	rts

	.org 0x04cc
ocia:
	push	r6
	mov.w	@0xfda2,r6
	jsr	@r6
	pop	r6
	rte

	.macro	handler name vector
\name:
	push	r6
	mov.w	@\vector,r6
	jsr	@r6
	pop	r6
	rte
	.endm

	handler	nmi 0xfd92
	handler	ocib 0xfda4
	handler	eri 0xfdb4
	handler	rxi 0xfdb6
	handler	txi 0xfdb8
	handler	tei 0xfdba
	handler	ad 0xfdbc

; r5 and r6, 32 bits, times r3 and r4. What the kernel measures the battery with; r0 to r4 may be lost.
multiply:
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
divide:
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

	.org 0x1b62		; lcd_show
	rts
	.org 0x27ac		; lcd_clear
	rts
	.org 0x2964		; power_init
	rts
	.org 0x2a62		; power_off
	jmp	@over

begun = 0xfdc0			; a second reset ends the simulator
