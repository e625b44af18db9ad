/* chip.h: the devices of the RCX's chip, an H8/3292 at 16 MHz, in simulated time. One clock period is called a state.
 *
 * Source: Hitachi H8/3297 Series Hardware Manual. Simulated are the timer FRT with its two compare matches, the watchdog as a timer,
 * the A/D converter in single mode, the serial interface in asynchronous mode, and the interrupts of all these. An interrupt that is
 * enabled but not simulated ends the simulator.
 *
 * Registers are bytes of the simulator's memory. Before each instruction chip_touch() gets the address of its data;
 * after it, chip_written() handles what a program wrote into a register. A device sets a flag. A program clears the
 * flag by writing 0 after it has read 1. So a flag that is set between this read and write stays set.
 */
#ifndef BRICKPILOT_H8SIM_CHIP_H
#define BRICKPILOT_H8SIM_CHIP_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

enum {
    TIER = 0xFF90,
    TCSR,
    FRC,
    OCR = 0xFF94,
    TCR = 0xFF96,
    TOCR,
    WDT = 0xFFA8,
    PORT4 = 0xFFB7,
    PORT6 = 0xFFBB,
    PORT7 = 0xFFBE,
    TCR_0 = 0xFFC8,
    TCR_1 = 0xFFD0,
    SMR = 0xFFD8,
    BRR,
    SCR,
    TDR,
    SSR,
    RDR,
    ADDR = 0xFFE0,
    ADCSR = 0xFFE8,
    REGISTERS = 0xFF88
};
enum { ADF = 0x80, ADIE = 0x40, ADST = 0x20, SCAN = 0x10, FAST = 0x08 };
enum { TDRE = 0x80, RDRF = 0x40, ORER = 0x20, PER = 0x08, TEND = 0x04, RIE = 0x40, TE = 0x20, RE = 0x10 };
enum { OCFA = 0x08, OCFB = 0x04, CCLRA = 0x01, OCRS = 0x10, OVF = 0x80, WATCHES = 0x40, TME = 0x20 };

static const uint64_t NEVER = UINT64_MAX;

/* What the processor spends its time on. The interrupts are in the order of their priority. */
enum { IDLE, PROGRAM, KERNEL, NMI, OCIA, OCIB, ERI, RXI, TXI, TEI, ADI, KINDS };

/* A maskable interrupt is pending if its flag is up and its enable bit is set. */
static const struct {
    uint16_t vector, flag_at;
    uint8_t flag;
    uint16_t enable_at;
    uint8_t enable;
} INTERRUPTS[KINDS] = {
    [OCIA] = {16, TCSR, OCFA, TIER, 0x08},   [OCIB] = {17, TCSR, OCFB, TIER, 0x04},
    [ERI] = {27, SSR, ORER | PER, SCR, RIE}, [RXI] = {28, SSR, RDRF, SCR, RIE},
    [TXI] = {29, SSR, TDRE, SCR, 0x80},      [TEI] = {30, SSR, TEND, SCR, 0x04},
    [ADI] = {35, ADCSR, ADF, ADCSR, ADIE},
};

/* Registers with such flags, and the flags' bits. A program may only clear these bits. */
enum { FLAGGED = 3 };
static const struct {
    uint16_t at;
    uint8_t flags;
} FLAGS[FLAGGED] = {{TCSR, 0xFE}, {SSR, 0xF8}, {ADCSR, ADF}};

static struct {
    uint8_t *memory;
    uint64_t now;                           /* states since the start */
    uint64_t next;                          /* time of the next event of any device */
    uint16_t touched;                       /* the register that the last instruction read or wrote; 0: none */
    uint8_t before[FLAGGED], seen[FLAGGED]; /* old contents of the registers in FLAGS; flags read as 1 */
    int pending;                            /* the pending maskable interrupt of highest priority; 0: none */
    bool nmi;

    uint64_t frt_setting, frt_zero, match_a, match_b; /* setting and start of the counter, times of the next matches */
    uint16_t ocr[2];
    uint8_t ocr_selected;

    uint64_t overflow; /* time at which the watchdog's counter overflows */
    uint8_t wdt_control;

    uint64_t converted;   /* time at which the conversion ends */
    uint16_t analogue[4]; /* the converter's four inputs, 0..1023 */

    uint64_t sent; /* time at which the byte in `sending` has been sent */
    uint8_t sending;
    void (*out)(uint8_t byte); /* takes the byte that was sent */

    uint64_t spent[KINDS];
    uint32_t count[KINDS];
} chip = {.next = 0,
          .match_a = UINT64_MAX,
          .match_b = UINT64_MAX,
          .overflow = UINT64_MAX,
          .converted = UINT64_MAX,
          .sent = UINT64_MAX};

static uint16_t word_at(uint16_t address)
{
    return (uint16_t)(chip.memory[address] << 8 | chip.memory[address + 1]);
}

static void put_word(uint16_t address, uint16_t word)
{
    chip.memory[address] = (uint8_t)(word >> 8);
    chip.memory[address + 1] = (uint8_t)word;
}

static void chip_fail(const char *what)
{
    fprintf(stderr, "h8sim: the chip's %s is not simulated\n", what);
    exit(6);
}

/* States per count of the timer FRT. It counts up from 0 to OCRA, or through all 65536 numbers. */
static uint64_t frt_tick(void)
{
    static const uint8_t STATES[] = {2, 8, 32};
    const uint8_t clock = chip.memory[TCR] & 3;

    if (clock == 3)
        chip_fail("external clock of FRT");
    return STATES[clock];
}

static uint64_t frt_period(void)
{
    return (chip.memory[TCSR] & CCLRA ? chip.ocr[0] + 1U : 0x10000U) * frt_tick();
}

/* Starts the counter at 0, when the timer is set up. A counter that is cleared at OCRA never reaches an OCRB above
 * OCRA. */
static void start_frt(void)
{
    const bool beyond = (chip.memory[TCSR] & CCLRA) != 0 && chip.ocr[1] > chip.ocr[0];

    chip.frt_zero = chip.now;
    chip.match_a = chip.now + (chip.ocr[0] + 1U) * frt_tick();
    chip.match_b = beyond ? NEVER : chip.now + (chip.ocr[1] + 1U) * frt_tick();
}

/* Time of one byte on the line, in states: start bit, eight bits, parity and stop bit. */
static uint64_t byte_states(void)
{
    return 11ULL * 32 * (1ULL << 2 * (chip.memory[SMR] & 3)) * (chip.memory[BRR] + 1U);
}

static uint64_t wdt_tick(void)
{
    static const uint16_t STATES[] = {2, 32, 64, 128, 256, 512, 2048, 4096};

    return STATES[chip.wdt_control & 7];
}

/* Sets the watchdog's counter. The prescaler runs on unchanged. */
static void start_wdt(uint8_t counter)
{
    chip.overflow = chip.wdt_control & TME ? (chip.now / wdt_tick() + 256U - counter) * wdt_tick() : NEVER;
}

static uint64_t earliest(uint64_t one, uint64_t other)
{
    return one < other ? one : other;
}

static void find_pending(void)
{
    chip.pending = 0;
    for (int kind = ADI; kind >= OCIA; kind--)
        if ((chip.memory[INTERRUPTS[kind].flag_at] & INTERRUPTS[kind].flag) != 0 &&
            (chip.memory[INTERRUPTS[kind].enable_at] & INTERRUPTS[kind].enable) != 0)
            chip.pending = kind;
    chip.next = earliest(chip.match_a, chip.match_b);
    chip.next = earliest(chip.next, chip.overflow);
    chip.next = earliest(chip.next, chip.converted);
    chip.next = earliest(chip.next, chip.sent);
}

static void keep_flags(void)
{
    for (int i = 0; i < FLAGGED; i++) {
        const uint8_t now = chip.memory[FLAGS[i].at], kept = chip.before[i] & (uint8_t)(now | ~chip.seen[i]);

        chip.memory[FLAGS[i].at] = (uint8_t)((now & ~FLAGS[i].flags) | (kept & FLAGS[i].flags));
        chip.seen[i] &= chip.memory[FLAGS[i].at];
    }
}

static void frt_written(void)
{
    const uint8_t selected = (chip.memory[TOCR] & OCRS) != 0;
    uint64_t setting;

    if (selected != chip.ocr_selected)
        put_word(OCR, chip.ocr[chip.ocr_selected = selected]);
    chip.ocr[selected] = word_at(OCR);
    if ((chip.memory[TIER] & 0xF2) != 0)
        chip_fail("capture or overflow interrupt of FRT");
    setting = (uint64_t)chip.ocr[0] << 32 | (uint64_t)chip.ocr[1] << 16 | (uint64_t)chip.memory[TCR] << 8 |
              (chip.memory[TCSR] & CCLRA);
    if (setting == chip.frt_setting)
        return;
    chip.frt_setting = setting;
    start_frt();
}

/* The watchdog's registers are written as words, with a key in the high byte. */
static void wdt_written(void)
{
    const uint16_t word = word_at(WDT);

    if (word >> 8 == 0x5A) {
        start_wdt((uint8_t)word);
    } else if (word >> 8 == 0xA5) {
        const bool began = (chip.wdt_control & TME) == 0;

        chip.wdt_control = (uint8_t)word & 0x7F;
        if ((word & WATCHES) == 0 || (word & 0x08) != 0)
            chip_fail("watchdog but for its NMI");
        if (began || (word & TME) == 0)
            start_wdt(0); /* a watchdog that is off holds its counter at 0 */
    }
    put_word(WDT, (uint16_t)(chip.wdt_control << 8));
}

static void converter_written(void)
{
    const uint8_t control = chip.memory[ADCSR];

    if ((control & ADST) == 0)
        chip.converted = NEVER;
    else if ((control & SCAN) != 0)
        chip_fail("scan mode of the converter");
    else if (chip.converted == NEVER)
        chip.converted = chip.now + (control & FAST ? 134 : 266);
}

static void load_sender(void)
{
    if ((chip.memory[SSR] & TDRE) != 0 || chip.sent != NEVER)
        return;
    chip.sending = chip.memory[TDR];
    chip.sent = chip.now + byte_states();
    chip.memory[SSR] = (uint8_t)((chip.memory[SSR] | TDRE) & ~TEND);
}

/* If TE is 0, nothing is sent, and a byte that is being sent is lost. */
static void serial_written(void)
{
    if ((chip.memory[SCR] & TE) == 0) {
        chip.sent = NEVER;
        chip.memory[SSR] |= TDRE | TEND;
    } else {
        load_sender();
    }
}

static void keep_before(void)
{
    for (int i = 0; i < FLAGGED; i++)
        chip.before[i] = chip.memory[FLAGS[i].at];
}

/* Called after an instruction that read or wrote a register. */
static void chip_written(void)
{
    const uint16_t at = chip.touched;

    chip.touched = 0;
    keep_flags();
    if (at >= TIER && at <= TOCR)
        frt_written();
    else if (at == WDT)
        wdt_written();
    else if (at == ADCSR)
        converter_written();
    else if (at >= SMR && at <= RDR)
        serial_written();
    else if ((at == TCR_0 || at == TCR_1) && (chip.memory[at] & 0xE0) != 0)
        chip_fail("interrupt of an 8-bit timer");
    keep_before();
    find_pending();
}

/* Called before an instruction that reads or writes data at `address`. */
static void chip_touch(uint16_t address)
{
    if (address < REGISTERS)
        return;
    chip.touched = address;
    for (int i = 0; i < FLAGGED; i++)
        if (address == FLAGS[i].at)
            chip.seen[i] |= chip.memory[address];
    if (address == FRC)
        put_word(FRC, (uint16_t)((chip.now - chip.frt_zero) % frt_period() / frt_tick()));
}

/* Takes a byte that comes on the line, or that the brick hears while it sends it. */
static void chip_receive(uint8_t byte, bool wrong)
{
    if ((chip.memory[SCR] & RE) == 0)
        return;
    if ((chip.memory[SSR] & RDRF) != 0) {
        chip.memory[SSR] |= ORER;
    } else {
        chip.memory[RDR] = byte;
        chip.memory[SSR] |= wrong ? PER : RDRF;
    }
    keep_before();
    find_pending();
}

/* While an input's power is on, the converter reads the battery's voltage there, not the sensor. Bits 0 to 2 of port 6
 * switch the power. */
static void end_conversion(void)
{
    const uint8_t input = chip.memory[ADCSR] & 3;
    const bool powered = input < 3 && (chip.memory[PORT6] >> input & 1) != 0;

    put_word((uint16_t)(ADDR + 2 * input), (uint16_t)((powered ? 1023 : chip.analogue[input]) << 6));
    chip.memory[ADCSR] = (uint8_t)((chip.memory[ADCSR] | ADF) & ~ADST);
    chip.converted = NEVER;
}

static void end_byte(void)
{
    const uint8_t byte = chip.sending;

    chip.sent = NEVER;
    chip.out(byte);
    if ((chip.memory[SSR] & TDRE) != 0)
        chip.memory[SSR] |= TEND;
    load_sender();
    chip_receive(byte, false);
}

/* Brings all devices up to the present time. */
static void chip_run(void)
{
    if (chip.match_a <= chip.now) {
        chip.memory[TCSR] |= OCFA;
        chip.match_a += frt_period();
    }
    if (chip.match_b <= chip.now) {
        chip.memory[TCSR] |= OCFB;
        chip.match_b += frt_period();
    }
    if (chip.overflow <= chip.now) {
        chip.overflow += 256 * wdt_tick();
        chip.nmi = true;
    }
    if (chip.converted <= chip.now)
        end_conversion();
    if (chip.sent <= chip.now)
        end_byte();
    keep_before();
    find_pending();
}

static void chip_start(uint8_t *memory)
{
    chip.memory = memory;
    chip.ocr[0] = chip.ocr[1] = 0xFFFF;
    put_word(OCR, 0xFFFF);
    memory[SSR] = TDRE | TEND;
    memory[BRR] = 0xFF;
    start_frt();
    keep_before();
    find_pending();
}

#endif
