/* decoded.h: hal/h8sim/simulator puts this file in place of the call of decode() in the simulator's main loop. It uses
 * the loop's variables sd, cpu, pc and code, and those of its condition codes.
 *
 * decode() searches its table for each executed instruction, which allows 0.2 million instructions per second. No
 * instruction of the H8/300 is longer than four bytes. So if the four bytes at an address are unchanged, this code uses
 * the earlier result: 30 million instructions per second.
 *
 * If the environment variable H8SIM_TRACE names a file, the address and the stack pointer of every instruction are written
 * there, two native 16-bit words each.
 *
 * If H8SIM_BRICK is set, the processor is that of an RCX: time passes, interrupts come (brick.h), and console.h uses
 * standard input and output.
 */
{
    static struct {
        unsigned char bytes[4];
        decoded_inst code;
    } decoded[0x10000];
    static FILE *trace;
    static int started, brick;
    unsigned char *at;

    if (!started) {
        const char *const path = getenv("H8SIM_TRACE");
        started = 1;
        h8_set_reg(cpu, SBR_REGNUM, 0xFF00); /* base of 8-bit addresses; the simulator leaves it at 0 */
        if (path && !(trace = fopen(path, "wb"))) {
            perror(path);
            exit(1);
        }
        if ((brick = getenv("H8SIM_BRICK") != NULL))
            brick_start(h8_get_memory_buf(cpu));
    }
    if (brick) {
        uint16_t registers[8];
        int kind;

        for (int number = 0; number < 8; number++)
            registers[number] = (uint16_t)h8_get_reg(cpu, number);
        if ((kind = brick_before((uint16_t)pc, intMaskBit != 0, registers)) != 0) {
            BUILDSR(cpu);
            pc = brick_interrupt(kind, (uint16_t)pc, (uint8_t)h8_get_ccr(cpu), &registers[STACK]);
            h8_set_reg(cpu, SP_REGNUM, registers[STACK]);
            intMaskBit = 1;
            continue;
        }
    }
    at = h8_get_memory_buf(cpu) + pc;
    if (!decoded[pc & 0xffff].code.opcode || memcmp(decoded[pc & 0xffff].bytes, at, 4)) {
        decode(sd, cpu, pc, at, code);
        memcpy(decoded[pc & 0xffff].bytes, at, 4);
        decoded[pc & 0xffff].code = *code;
    } else {
        *code = decoded[pc & 0xffff].code;
    }
    if (trace) {
        const unsigned short row[2] = {pc, h8_get_reg(cpu, SP_REGNUM)};
        fwrite(row, sizeof row, 1, trace);
    }
}
