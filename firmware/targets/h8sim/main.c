/* main.c: the firmware on the H8/300 instruction-set simulator. It reads and writes frames of wire/frame.h on standard
 * input and output. In lockstep, it makes a step as soon as a set of readings is complete and STEP_MS has passed. The
 * program ends when its input ends.
 */
#include "app/serve.h"
#include "h8sim/system.h"
#include "hal.h"
#include "link/link.h"
#include "wire/frame.h"

enum { STDIN = 0, STDOUT = 1, READ_MOST = 128, WRITE_MOST = 240 };

static link_port_t port;
static commands_t commands;
static loop_state_t loop;
static uint8_t output[WRITE_MOST];
static uint8_t output_size;

static void flush(void)
{
    uint8_t done = 0;
    while (done < output_size) {
        const int16_t written = h8sim_write(STDOUT, &output[done], (uint16_t)(output_size - done));
        if (written <= 0)
            break;
        done = (uint8_t)(done + written);
    }
    output_size = 0;
}

/* The host's plant steps every 3 ms, whatever STEP_MS is. */
static bool is_due(void)
{
    return !loop.started || hal_clock_ms() - loop.clock_ms >= STEP_MS;
}

static void take(const message_t *message)
{
    const link_event_t event = link_take(&port, message);
    message_t answer;

    if (event != LINK_NOTHING)
        serve(&commands, &loop);
    if (event == LINK_STEP) {
        if (is_due())
            loop_tick(&commands.parameters.config, &commands.route, &loop, commands_next(&commands));
        else
            hal_motors_write(loop.output.drive.left_q15, loop.output.drive.right_q15); /* the motors keep their duty */
        link_stepped(&port);
    }
    while (link_give(&port, &answer)) {
        if (output_size > WRITE_MOST - FRAME_SIZE_MAX)
            flush();
        output_size = (uint8_t)(output_size + frame_encode(&answer, &output[output_size]));
    }
}

int main(void)
{
    static frame_decoder_t decoder;
    static uint8_t input[READ_MOST];
    message_t message;
    int16_t size;

    link_bind(&port);
    commands_start(&commands);
    while ((size = h8sim_read(STDIN, input, READ_MOST)) > 0) {
        for (int16_t i = 0; i < size; i++) {
            const frame_status_t status = frame_take(&decoder, input[i], &message);
            if (status == FRAME_MESSAGE)
                take(&message);
            else if (status == FRAME_BAD)
                link_count_bad(&port);
        }
        flush();
    }
    return 0;
}
