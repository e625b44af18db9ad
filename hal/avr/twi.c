#include "avr/twi.h"

#include "avr/pins.h"
#define F_CPU BOARD_CPU_HZ
#include <avr/interrupt.h>
#include <avr/io.h>
#include <stdbool.h>
#include <util/delay.h>

#if BOARD_IMU != BOARD_ANALOGUE

/* The bus clock is the chip's clock divided by 16 + 2 TWBR. */
enum { HERTZ = 400000, RATE = (BOARD_CPU_HZ / HERTZ - 16) / 2 };

/* Values of TWSR: what has happened on the bus. simavr reports the acknowledge of an address as that of a byte; this
 * file treats both alike. */
enum {
    STARTED = 0x08,
    STARTED_AGAIN = 0x10,
    ADDRESS_TAKEN = 0x18,
    BYTE_TAKEN = 0x28,
    WILL_SEND = 0x40,
    BYTE_CAME = 0x50,
    LAST_CAME = 0x58,
    EVENT = 0xF8
};
enum { GO = 1U << TWINT | 1U << TWEN | 1U << TWIE, STOP = 1U << TWINT | 1U << TWEN | 1U << TWSTO };
enum { READ = 1, CLOCKS = 9, HALF_US = 5 };

static uint8_t device, out[TWI_OUT], in[TWI_IN];
static uint8_t to_send, to_get, sent, got;
static volatile twi_state_t state;

static void end(twi_state_t how)
{
    TWCR = STOP;
    state = how;
}

/* Starts to receive a byte. The last byte is not acknowledged, so that the device releases the line. */
static void await_byte(void)
{
    TWCR = got + 1 < to_get ? GO | 1U << TWEA : GO;
}

static void go_on_sending(void)
{
    if (sent < to_send) {
        TWDR = out[sent];
        sent++;
        TWCR = GO;
    } else if (to_get > 0) {
        TWCR = GO | 1U << TWSTA;
    } else {
        end(TWI_DONE);
    }
}

ISR(TWI_vect)
{
    switch (TWSR & EVENT) {
    case STARTED:
    case STARTED_AGAIN:
        TWDR = (uint8_t)(device << 1 | (sent == to_send ? READ : 0));
        TWCR = GO;
        break;
    case ADDRESS_TAKEN:
    case BYTE_TAKEN:
        go_on_sending();
        break;
    case WILL_SEND:
        await_byte();
        break;
    case BYTE_CAME:
        in[got] = TWDR;
        got++;
        await_byte();
        break;
    case LAST_CAME:
        in[got] = TWDR;
        end(TWI_DONE);
        break;
    default:
        end(TWI_REFUSED);
        break;
    }
}

void twi_begin(uint8_t address, const uint8_t *bytes, uint8_t out_size, uint8_t in_size)
{
    for (uint8_t i = 0; i < out_size; i++)
        out[i] = bytes[i];
    device = address;
    to_send = out_size;
    to_get = in_size;
    sent = got = 0;
    state = TWI_BUSY;
    TWCR = GO | 1U << TWSTA;
}

twi_state_t twi_state(void)
{
    return state;
}

const uint8_t *twi_received(void)
{
    return in;
}

/* A line is low while its pin is an output; while the pin is an input, the pull-up resistor makes the line high. */
#define PULL(...) (PINS_DIRECTION(__VA_ARGS__) |= PINS_BIT(__VA_ARGS__))
#define LET_GO(...) (PINS_DIRECTION(__VA_ARGS__) &= (uint8_t)~PINS_BIT(__VA_ARGS__))

void twi_free(void)
{
    TWCR = 0;
    for (uint8_t i = 0; i < CLOCKS; i++) {
        PULL(BOARD_SCL);
        _delay_us(HALF_US);
        LET_GO(BOARD_SCL);
        _delay_us(HALF_US);
    }
    PULL(BOARD_SDA); /* now a stop condition: the data line rises while the clock is high */
    _delay_us(HALF_US);
    LET_GO(BOARD_SDA);
    state = TWI_REFUSED;
}

void twi_start(void)
{
    TWBR = RATE;
    twi_free();
}

#endif
