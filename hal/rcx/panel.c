#include "rcx/panel.h"

#include <conio.h>

enum { TEXT_SIZE = 6 };

uint8_t panel_pressed(void)
{
    static uint8_t before = KEY_ANY; /* what started the program is none of its business */
    const uint8_t now = dkey_multi;
    const uint8_t pressed = (uint8_t)(now & ~before & (PANEL_VIEW | PANEL_PRGM));

    before = now;
    return pressed;
}

static const char *text_of(const mode_state_t *mode, bool starting, uint8_t *number)
{
    switch (mode->mode) {
    case MODE_RUN:
        *number = (uint8_t)(mode->los.waypoint + 1);
        return "run";
    case MODE_ARRIVED:
        return "donE";
    case MODE_FAULT:
        *number = (uint8_t)mode->fault;
        return "Err";
    case MODE_IDLE:
        break;
    }
    return starting ? "rESt" : "idLE";
}

void panel_show(const mode_state_t *mode, bool starting)
{
    static const char *shown;
    static uint8_t shown_number;
    uint8_t number = 0, tens = 0, at = 0;
    const char *const text = text_of(mode, starting, &number);
    char line[TEXT_SIZE];

    if (text == shown && number == shown_number)
        return;
    shown = text;
    shown_number = number;
    for (; text[at] != '\0'; at++)
        line[at] = text[at];
    if (number > 0) {
        for (; number >= 10; number = (uint8_t)(number - 10))
            tens++;
        line[at++] = tens > 0 ? (char)('0' + tens) : ' ';
        line[at++] = (char)('0' + number);
    }
    line[at] = '\0';
    cputs(line);
}
