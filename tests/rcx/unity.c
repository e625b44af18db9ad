#include "unity.h"

const char *unity_rule;

static const char *running;
static const char *ignored;

void unity_check(bool holds, uint16_t line)
{
    if (holds)
        return;
    world_say(running);
    world_say(": FAIL: line ");
    world_say_number(line);
    if (unity_rule != 0) {
        world_say(". Broken rule: ");
        world_say(unity_rule);
    }
    world_say("\n");
    world_exit(1);
}

bool unity_ignored(const char *why)
{
    ignored = why;
    return true;
}

bool unity_same(const void *one, const void *other, uint16_t size)
{
    const uint8_t *a = (const uint8_t *)one;
    const uint8_t *b = (const uint8_t *)other;
    while (size-- > 0)
        if (*a++ != *b++)
            return false;
    return true;
}

void unity_run(void (*test)(void), const char *name)
{
    running = name;
    ignored = 0;
    unity_rule = 0;
    setUp();
    test();
    tearDown();
    world_say(name);
    world_say(ignored == 0 ? ": PASS" : ": SKIP: ");
    if (ignored != 0)
        world_say(ignored);
    world_say("\n");
}
