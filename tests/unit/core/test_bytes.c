#include "core/bytes.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

static void test_bytes_are_copied_and_cleared_to_the_last_and_no_further(void)
{
    static const uint8_t FROM[4] = {1, 2, 3, 4};
    uint8_t to[4] = {9, 9, 9, 9};
    bytes_copy(to, FROM, 3);
    TEST_ASSERT_EQUAL_UINT8(3, to[2]);
    TEST_ASSERT_EQUAL_UINT8(9, to[3]);
    bytes_clear(to, 3);
    TEST_ASSERT_EQUAL_UINT8(0, to[0]);
    TEST_ASSERT_EQUAL_UINT8(0, to[2]);
    TEST_ASSERT_EQUAL_UINT8(9, to[3]);
    bytes_copy(to, FROM, 1);
    TEST_ASSERT_EQUAL_UINT8(1, to[0]);
    TEST_ASSERT_EQUAL_UINT8(0, to[1]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_bytes_are_copied_and_cleared_to_the_last_and_no_further);
    return UNITY_END();
}
