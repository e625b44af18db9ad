#include "wire/slcan.h"

enum { HEAD = 5, NO_DIGIT = 16 };

static uint8_t digit(uint8_t value)
{
    return (uint8_t)(value < 10 ? '0' + value : 'A' + value - 10);
}

static uint8_t value_of(uint8_t character)
{
    if (character >= '0' && character <= '9')
        return (uint8_t)(character - '0');
    if (character >= 'A' && character <= 'F')
        return (uint8_t)(character - 'A' + 10);
    if (character >= 'a' && character <= 'f')
        return (uint8_t)(character - 'a' + 10);
    return NO_DIGIT;
}

uint8_t slcan_encode(const message_t *message, uint8_t bytes[SLCAN_SIZE_MAX])
{
    uint8_t at = HEAD;

    bytes[0] = 't';
    bytes[1] = digit((uint8_t)(message->id >> 8) & 7U);
    bytes[2] = digit((uint8_t)(message->id >> 4) & 15U);
    bytes[3] = digit((uint8_t)message->id & 15U);
    bytes[4] = digit(message->size);
    for (uint8_t i = 0; i < message->size; i++) {
        bytes[at++] = digit((uint8_t)(message->data[i] >> 4));
        bytes[at++] = digit(message->data[i] & 15U);
    }
    bytes[at++] = '\r';
    return at;
}

static bool parse(const uint8_t *line, uint8_t size, message_t *message)
{
    for (uint8_t i = 1; i < size; i++)
        if (value_of(line[i]) == NO_DIGIT)
            return false;
    if (size < HEAD || value_of(line[1]) > 7 || value_of(line[4]) > MESSAGE_DATA_MAX ||
        size != HEAD + 2 * value_of(line[4]))
        return false;
    message->id =
        (uint16_t)(((uint16_t)value_of(line[1]) << 8) | (uint16_t)(value_of(line[2]) << 4) | value_of(line[3]));
    message->size = value_of(line[4]);
    for (uint8_t i = 0; i < message->size; i++)
        message->data[i] = (uint8_t)((uint8_t)(value_of(line[HEAD + 2 * i]) << 4) | value_of(line[HEAD + 2 * i + 1]));
    return true;
}

static slcan_status_t reply(slcan_decoder_t *decoder, const char *text)
{
    decoder->reply_size = 0;
    while (*text != 0)
        decoder->reply[decoder->reply_size++] = (uint8_t)*text++;
    return SLCAN_REPLY;
}

static slcan_status_t obey(slcan_decoder_t *decoder, uint8_t size)
{
    const uint8_t command = decoder->line[0];

    if (size == 1 && (command == 'O' || command == 'C'))
        decoder->open = command == 'O';
    else if (size == 1 && command == 'V')
        return reply(decoder, "V0101\r");
    else if (size == 1 && command == 'N')
        return reply(decoder, "N0001\r");
    else if (size != 0 && !(size == 2 && command == 'S' && decoder->line[1] >= '0' && decoder->line[1] <= '8'))
        return reply(decoder, "\a");
    return reply(decoder, "\r");
}

slcan_status_t slcan_take(slcan_decoder_t *decoder, uint8_t byte, message_t *message)
{
    const uint8_t size = decoder->size;
    const bool overlong = decoder->overlong;

    if (byte != '\r') {
        if (size < sizeof decoder->line)
            decoder->line[decoder->size++] = byte;
        else
            decoder->overlong = true;
        return SLCAN_MORE;
    }
    decoder->size = 0;
    decoder->overlong = false;
    if (overlong)
        return reply(decoder, "\a");
    if (size > 0 && decoder->line[0] == 't')
        return decoder->open && parse(decoder->line, size, message) ? SLCAN_MESSAGE : reply(decoder, "\a");
    return obey(decoder, size);
}
