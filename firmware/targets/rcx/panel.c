#include "targets/rcx/panel.h"

#include <conio.h>

uint8_t panel_pressed(void)
{
    static uint8_t before = KEY_ANY; /* the press that started the program does not count */
    const uint8_t now = dkey_multi;
    const uint8_t pressed = (uint8_t)(now & ~before & (PANEL_VIEW | PANEL_PRGM));

    before = now;
    return pressed;
}

void panel_show(const mode_state_t *mode, bool starting)
{
    enum { STARTING = MODE_FAULT + 1, SIZE = 6 };
    static const char TEXTS[][SIZE] = {[MODE_IDLE] = "idLE ",
                                       [MODE_RUN] = "run  ",
                                       [MODE_ARRIVED] = "donE ",
                                       [MODE_FAULT] = "Err  ",
                                       [STARTING] = "rESt "};
    static uint16_t shown;
    const uint8_t text = starting && mode->mode == MODE_IDLE ? STARTING : (uint8_t)mode->mode;
    uint8_t number = 0;
    uint16_t shows;
    char line[SIZE];

    if (text == MODE_RUN)
        number = (uint8_t)(mode->los.waypoint + 1);
    else if (text == MODE_FAULT)
        number = (uint8_t)mode->fault;
    shows = (uint16_t)(number << 8 | (text + 1));
    if (shows == shown)
        return;
    shown = shows;
    for (uint8_t i = 0; i < SIZE; i++)
        line[i] = TEXTS[text][i];
    if (number > 0) {
        for (; number >= 10; number = (uint8_t)(number - 10))
            line[3] = line[3] == ' ' ? '1' : (char)(line[3] + 1);
        line[4] = (char)('0' + number);
    }
    cputs(line);
}
