/* decoded.h: hal/h8sim/simulator puts this in place of the call of decode() in the simulator's main loop. It uses the loop's
 * variables sd, cpu, pc and code.
 *
 * decode() searches its table of instructions for every instruction that it executes: 0.2 million per second. No instruction of
 * the H8/300 is longer than four bytes, so an address whose four bytes are still the same needs no second search: 30 million per
 * second.
 *
 * If the environment variable H8SIM_TRACE names a file, the address and the stack pointer of every instruction are written
 * there, two native 16-bit words each.
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
        const unsigned short row[2] = {pc, h8_get_reg(cpu, SP_REGNUM)};
        fwrite(row, sizeof row, 1, trace);
    }
}
