#include "brick/brick.h"

void brick_start(brick_t *brick)
{
    *brick = (brick_t){.now_us = 0};
    commands_start(&brick->commands);
}

static void step(brick_t *brick)
{
    serve(&brick->commands, &brick->loop);
    loop_tick(&brick->commands.parameters.config, &brick->commands.route, &brick->loop,
              commands_next(&brick->commands));
    link_stepped(&brick->port);
}

void brick_take(brick_t *brick, const message_t *message)
{
    const bool was_open = brick->commands.open;
    const bool was_realtime = brick->commands.realtime;
    link_event_t event;

    link_bind(&brick->port);
    event = link_take(&brick->port, message);
    if (event == LINK_MESSAGE)
        serve(&brick->commands, &brick->loop);
    if (event == LINK_STEP && !brick->commands.realtime)
        step(brick);
    if (event != LINK_NOTHING)
        brick->heard_us = brick->now_us;
    if (brick->commands.realtime && !(was_open && was_realtime))
        brick->next_us = brick->now_us;
    link_bind(NULL);
}

bool brick_give(brick_t *brick, message_t *message)
{
    return link_give(&brick->port, message);
}

static int64_t keep_pace(brick_t *brick)
{
    if (brick->now_us >= brick->next_us) {
        brick->port.clock_ms = (uint32_t)(brick->now_us / 1000);
        step(brick);
        brick->next_us += BRICK_STEP_US;
        if (brick->next_us <= brick->now_us) /* late by more than a step: missed steps are skipped */
            brick->next_us = brick->now_us - (brick->now_us - brick->next_us) % BRICK_STEP_US + BRICK_STEP_US;
    }
    return brick->next_us - brick->now_us;
}

static int64_t watch(brick_t *brick)
{
    const int64_t silent_us = brick->now_us - brick->heard_us;

    if (silent_us < BRICK_SILENT_US)
        return BRICK_SILENT_US - silent_us;
    if (brick->loop.step.mode.mode == MODE_RUN) {
        brick->port.clock_ms += (uint32_t)(BRICK_SILENT_US / 1000);
        step(brick);
    }
    brick->heard_us = brick->now_us;
    return BRICK_SILENT_US;
}

int64_t brick_time(brick_t *brick, int64_t now_us)
{
    int64_t wait_us;

    link_bind(&brick->port);
    brick->now_us = now_us;
    wait_us = brick->commands.open && brick->commands.realtime ? keep_pace(brick) : watch(brick);
    link_bind(NULL);
    return wait_us;
}
