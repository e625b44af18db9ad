#include "avr/serial.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "avr/board.h"

enum { DIVISOR = (BOARD_CPU_HZ + 4 * BOARD_BAUD) / (8 * BOARD_BAUD) - 1 }; /* mode U2X: 8 samples per bit */

/* Only interrupts write in_put and out_taken; only the program writes in_taken and out_put. Bytes need no lock. */
static volatile uint8_t in[SERIAL_IN], out[SERIAL_OUT];
static volatile uint8_t in_put, in_taken, out_put, out_taken;
static volatile uint16_t overruns;

static uint8_t next_in(uint8_t index)
{
    return (uint8_t)(index + 1U) & (SERIAL_IN - 1U);
}

static uint8_t next_out(uint8_t index)
{
    return (uint8_t)(index + 1U) & (SERIAL_OUT - 1U);
}

static inline void count_overrun(void)
{
    if (overruns < 65535U)
        overruns++;
}

#ifndef USART_RX_vect
#define USART_RX_vect USART0_RX_vect
#define USART_UDRE_vect USART0_UDRE_vect
#endif

ISR(USART_RX_vect)
{
    const uint8_t status = UCSR0A, byte = UDR0; /* read in this order: the status belongs to the byte */
    const uint8_t put = next_in(in_put);

    if (status & 1U << DOR0)
        count_overrun();
    if (put == in_taken) {
        count_overrun();
        return;
    }
    in[in_put] = byte;
    in_put = put;
}

ISR(USART_UDRE_vect)
{
    const uint8_t taken = out_taken;

    if (taken == out_put) {
        UCSR0B &= (uint8_t) ~(1U << UDRIE0);
        return;
    }
    UDR0 = out[taken];
    out_taken = next_out(taken);
}

void serial_start(void)
{
    UBRR0 = DIVISOR;
    UCSR0A = 1U << U2X0;
    UCSR0C = 1U << UCSZ01 | 1U << UCSZ00;
    UCSR0B = 1U << RXCIE0 | 1U << RXEN0 | 1U << TXEN0;
}

bool serial_read(uint8_t *byte)
{
    const uint8_t taken = in_taken;

    if (taken == in_put)
        return false;
    *byte = in[taken];
    in_taken = next_in(taken);
    return true;
}

bool serial_has_room(uint8_t size)
{
    return ((uint8_t)(out_taken - out_put - 1U) & (SERIAL_OUT - 1U)) >= size;
}

void serial_write(const uint8_t *bytes, uint8_t size)
{
    uint8_t put = out_put;

    for (; size > 0; size--) {
        out[put] = *bytes++;
        put = next_out(put);
    }
    out_put = put;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        UCSR0B |= 1U << UDRIE0;
    }
}

uint16_t serial_overruns(void)
{
    uint16_t counted;

    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        counted = overruns;
    }
    return counted;
}
