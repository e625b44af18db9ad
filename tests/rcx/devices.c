/* devices.c: the RCX's inputs, buttons and infrared line, the same for a program beside the kernel (world.c) and for the kernel alone. */
#include "world.h"

#include <dkey.h>
#include <dsensor.h>
#include <sys/h8.h>
#include <sys/irq.h>

void world_convert(uint8_t input, uint16_t raw)
{
    volatile unsigned *const converter = input == 0   ? &BATTERY
                                         : input == 1 ? &SENSOR_1
                                         : input == 2 ? &SENSOR_2
                                                      : &SENSOR_3;
    *converter = raw << 6;
}

void world_press(uint8_t keys)
{
    PORT4 = (unsigned char)((keys & KEY_ONOFF ? 0 : 2) | (keys & KEY_RUN ? 0 : 4));
    PORT7 = (unsigned char)((keys & KEY_VIEW ? 0 : 0x40) | (keys & KEY_PRGM ? 0 : 0x80));
}

bool world_line(bool disturbed, uint8_t *sent)
{
    if ((S_CR & SCR_TX_IRQ) != 0) {
        S_SR = (unsigned char)(S_SR | SSR_TRANS_EMPTY);
        world_interrupt(txi_vector);
        if ((S_CR & SCR_TX_IRQ) == 0)
            return false;
        *sent = S_TDR;
        S_RDR = disturbed ? (unsigned char)~S_TDR : S_TDR;
        world_interrupt(rxi_vector);
        return true;
    }
    if ((S_CR & SCR_TE_IRQ) != 0)
        world_interrupt(tei_vector);
    return false;
}
