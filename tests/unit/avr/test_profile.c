/* What a program's parts cost: cycles by function, interrupts apart, and the depth of the stack. */
#include "avr/profile.h"
#include "unity.h"

enum {
    STEP = 0,
    STAGE = 1,
    OTHER = 2,
    VECTORS_END = 0x68,
    ENTRY = 0x100,
    STAGE_ENTRY = 0x200,
    OTHER_ENTRY = 0x300,
    ELSEWHERE = 0x400
};

static bp_avr_costs rows[4];
static profile_t profile;

void setUp(void)
{
    profile = (profile_t){.function = {{ENTRY, STEP}, {STAGE_ENTRY, STAGE}, {OTHER_ENTRY, OTHER}},
                          .functions = 3,
                          .vectors_end = VECTORS_END,
                          .lowest_stack = UINT16_MAX,
                          .rows = rows,
                          .room = 4};
}
void tearDown(void) {}

static void test_a_stage_within_the_step_is_apart_and_what_it_calls_is_its_own(void)
{
    profile_look(&profile, 10, ENTRY, 800, false);           /* 10 before the step */
    profile_look(&profile, 15, STAGE_ENTRY, 798, false);     /* 5 in the step */
    profile_look(&profile, 18, OTHER_ENTRY, 790, false);     /* 3 in the stage */
    profile_look(&profile, 22, STAGE_ENTRY + 2, 798, false); /* 4 of the function that it called */
    profile_look(&profile, 24, ENTRY + 2, 800, false);       /* 2 up to its return */
    profile_look(&profile, 25, ELSEWHERE, 802, false);       /* 1, and the step returns */
    TEST_ASSERT_EQUAL(1, profile.ended);
    TEST_ASSERT_EQUAL(6, rows[0].part[STEP]);
    TEST_ASSERT_EQUAL(9, rows[0].part[STAGE]);
    TEST_ASSERT_EQUAL(0, rows[0].part[OTHER]);
    TEST_ASSERT_EQUAL(25, rows[0].awake);
    TEST_ASSERT_EQUAL(790, profile.lowest_stack);
}

static void test_an_interrupt_counts_apart_and_its_calls_too(void)
{
    profile_look(&profile, 10, ENTRY, 800, false);
    profile_look(&profile, 12, 0x20, 798, false);        /* an interrupt after 2 cycles of the step */
    profile_look(&profile, 15, STAGE_ENTRY, 796, false); /* it calls a function that is a stage elsewhere */
    profile_look(&profile, 20, ENTRY + 2, 800, false);
    profile_look(&profile, 21, ELSEWHERE, 802, false);
    TEST_ASSERT_EQUAL(8, rows[0].interrupts);
    TEST_ASSERT_EQUAL(3, rows[0].part[STEP]);
    TEST_ASSERT_EQUAL(0, rows[0].part[STAGE]);
}

static void test_sleep_costs_nothing_and_each_step_begins_anew(void)
{
    profile_look(&profile, 1000, ELSEWHERE, 802, true);
    profile_look(&profile, 1001, ENTRY, 800, false);
    profile_look(&profile, 1005, ELSEWHERE, 802, false);
    profile_look(&profile, 9000, ELSEWHERE, 802, true);
    profile_look(&profile, 9000, OTHER_ENTRY, 800, false);
    profile_look(&profile, 9007, ENTRY, 800, false); /* no return has been seen: it counts as called by the other */
    profile_look(&profile, 9009, ELSEWHERE, 802, false);
    profile_look(&profile, 9010, ENTRY, 800, false);
    profile_look(&profile, 9011, ELSEWHERE, 802, false);
    TEST_ASSERT_EQUAL(2, profile.ended);
    TEST_ASSERT_EQUAL(5, rows[0].awake);
    TEST_ASSERT_EQUAL(9, rows[1].part[OTHER]);
    TEST_ASSERT_EQUAL(1, rows[1].part[STEP]);
    TEST_ASSERT_EQUAL(11, rows[1].awake);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_stage_within_the_step_is_apart_and_what_it_calls_is_its_own);
    RUN_TEST(test_an_interrupt_counts_apart_and_its_calls_too);
    RUN_TEST(test_sleep_costs_nothing_and_each_step_begins_anew);
    return UNITY_END();
}
