/* decoded.h: what hal/h8sim/simulator puts into the simulator's main loop in place of its call of decode(), with the loop's own
 * variables sd, cpu, pc and code. It searches its table of instructions for every one it executes, 0.2 million a second: a place
 * whose four bytes are still the same (no instruction of the H8/300 is longer) has been decoded before, 30 million a second.
 *
 * With H8SIM_TRACE=FILE in the environment every instruction's address and stack pointer are written there, two native
 * 16-bit words each.
 */
{
    static struct {
        unsigned char bytes[4];
        decoded_inst code;
    } decoded[0x10000];
    static FILE *trace;
    static int started;
    unsigned char *const at = h8_get_memory_buf(cpu) + pc;

    if (!started) {
        const char *const path = getenv("H8SIM_TRACE");
        started = 1;
        if (path && !(trace = fopen(path, "wb"))) {
            perror(path);
            exit(1);
        }
    }
    if (!decoded[pc & 0xffff].code.opcode || memcmp(decoded[pc & 0xffff].bytes, at, 4)) {
        decode(sd, cpu, pc, at, code);
        memcpy(decoded[pc & 0xffff].bytes, at, 4);
        decoded[pc & 0xffff].code = *code;
    } else {
        *code = decoded[pc & 0xffff].code;
    }
    if (trace) {
        const unsigned short record[2] = {pc, h8_get_reg(cpu, SP_REGNUM)};
        fwrite(record, sizeof record, 1, trace);
    }
}
