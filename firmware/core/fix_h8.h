/* fix_h8.h: the products in the RCX's own instructions, half as many as the compiler makes of the C forms: a step has 117.
 * Included by fix.c alone. tests/gates/test_h8_arithmetic.py compares it with the C form. */
#ifndef BRICKPILOT_CORE_FIX_H8_H
#define BRICKPILOT_CORE_FIX_H8_H

/* r0, r1: the factors; r0 high and r1 low word of the product; r2, r3 are free. */
__asm__("\t.text\n"
        "\t.align 1\n"
        "\t.global _fix_mul_u16\n"
        "_fix_mul_u16:\n"
        "\tmov.w r4,@-r7\n"
        "\tmov.b r0l,r2l\n"
        "\tmulxu.b r1l,r2\n" /* low times low */
        "\tmov.b r0h,r3l\n"
        "\tmulxu.b r1l,r3\n" /* the middle: high times low, low times high */
        "\tmov.b r0l,r4l\n"
        "\tmulxu.b r1h,r4\n"
        "\tmov.b r0h,r0l\n"
        "\tmulxu.b r1h,r0\n" /* high times high */
        "\tmov.b r2l,r1l\n"
        "\tmov.b r2h,r2l\n"
        "\tsub.b r2h,r2h\n"
        "\tadd.w r2,r3\n" /* at most 255 * 255 + 254 */
        "\tadd.w r4,r3\n"
        "\tbcc .Lfix_no_carry\n"
        "\tadd.b #1,r0h\n"
        ".Lfix_no_carry:\n"
        "\tmov.b r3l,r1h\n"
        "\tmov.b r3h,r3l\n"
        "\tsub.b r3h,r3h\n"
        "\tadd.w r3,r0\n"
        "\tmov.w @r7+,r4\n"
        "\trts\n");

/* The signed product: that of unsigned numbers, less 65536 times the other factor for each that is negative. */
__asm__("\t.align 1\n"
        "\t.global _fix_mul\n"
        "_fix_mul:\n"
        "\tmov.w r0,@-r7\n"
        "\tmov.w r1,@-r7\n"
        "\tbsr _fix_mul_u16\n"
        "\tmov.w @r7+,r2\n"
        "\tbpl .Lfix_second_positive\n"
        "\tmov.w @r7,r3\n"
        "\tsub.w r3,r0\n"
        ".Lfix_second_positive:\n"
        "\tmov.w @r7+,r3\n"
        "\tbpl .Lfix_first_positive\n"
        "\tsub.w r2,r0\n"
        ".Lfix_first_positive:\n"
        "\trts\n");

#endif
