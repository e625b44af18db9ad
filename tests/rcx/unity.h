/* unity.h: the part of Unity that the contract suite uses, for a processor without a C library. The first check that does not
 * hold ends the program. */
#ifndef BRICKPILOT_RCX_UNITY_H
#define BRICKPILOT_RCX_UNITY_H

#include "world.h"

extern const char *unity_rule; /* the rule of the checks that follow; 0: none */

void setUp(void);
void tearDown(void);
void unity_check(bool holds, uint16_t line);
bool unity_ignored(const char *why);
bool unity_same(const void *one, const void *other, uint16_t size);
void unity_run(void (*test)(void), const char *name);

#define UNITY_CHECK(holds) unity_check(holds, __LINE__)
#define UNITY_EQUAL(wanted, got) UNITY_CHECK((wanted) == (got))

#define TEST_ASSERT_TRUE(got) UNITY_CHECK(got)
#define TEST_ASSERT_FALSE(got) UNITY_CHECK(!(got))
#define TEST_ASSERT_EQUAL UNITY_EQUAL
#define TEST_ASSERT_EQUAL_INT UNITY_EQUAL
#define TEST_ASSERT_EQUAL_INT16 UNITY_EQUAL
#define TEST_ASSERT_EQUAL_UINT16 UNITY_EQUAL
#define TEST_ASSERT_EQUAL_HEX16 UNITY_EQUAL
#define TEST_ASSERT_EQUAL_UINT8 UNITY_EQUAL
#define TEST_ASSERT_EQUAL_INT32 UNITY_EQUAL
#define TEST_ASSERT_LESS_THAN_INT(most, got) UNITY_CHECK((got) < (most))
#define TEST_ASSERT_GREATER_OR_EQUAL_UINT32(least, got) UNITY_CHECK((got) >= (least))
#define TEST_ASSERT_UINT32_WITHIN(by, wanted, got)                                                                     \
    UNITY_CHECK((uint32_t)(got) + (by) >= (wanted) && (uint32_t)(got) <= (uint32_t)(wanted) + (by))
#define TEST_ASSERT_EQUAL_MEMORY(wanted, got, size) UNITY_CHECK(unity_same(wanted, got, size))
#define TEST_IGNORE_MESSAGE(why)                                                                                       \
    do {                                                                                                               \
        if (unity_ignored(why))                                                                                        \
            return;                                                                                                    \
    } while (0)

#define UNITY_BEGIN()
#define RUN_TEST(test) unity_run(test, #test)
#define UNITY_END() 0

#endif
