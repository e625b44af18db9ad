/* The token's HMAC against the vectors of RFC 4231, and proofs that differ by who gives them. */
#include <string.h>

#include "brick/token.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

static void check_hmac(const char *key, const char *text, const char *wanted)
{
    char digits[TOKEN_PROOF + 1];
    uint8_t mac[32];

    token_hmac(key, text, mac);
    token_digits(mac, sizeof mac, digits);
    TEST_ASSERT_EQUAL_STRING(wanted, digits);
}

static void test_hmac_is_that_of_rfc_4231(void)
{
    check_hmac("\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b\x0b", "Hi There",
               "b0344c61d8db38535ca8afceaf0bf12b881dc200c9833da726e9376c2e32cff7");
    check_hmac("Jefe", "what do ya want for nothing?",
               "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843");
}

static void test_a_text_may_end_anywhere_in_a_block(void)
{
    static const char TEXT[] = "0123456789012345678901234567890123456789012345678901234567890123456789";
    char text[sizeof TEXT];

    memcpy(text, TEXT, sizeof text);
    text[56] = 0; /* the length takes a block more */
    check_hmac("key", text, "4ef2b76bce9306517bea7fa3033b121aed944da119a9294c2cc28f7e7306abc2");
    text[56] = '6';
    text[55] = 0;
    check_hmac("key", text, "c8454803cb0f31736d351a188155f0e97219701d453f6079a41e538c3fbe41b4");
    check_hmac("key", TEXT, "86089e85d84f5867657bcd47e5ce73c8c39971bdf78e193d68eca1ae93b46e38");
}

static void test_each_end_has_a_proof_of_its_own(void)
{
    static const char CHALLENGE[] = "00112233445566778899aabbccddeeff", ANSWER[] = "ffeeddccbbaa99887766554433221100";
    char host[TOKEN_PROOF + 1], brick[TOKEN_PROOF + 1], again[TOKEN_PROOF + 1];

    token_proof("a token of some length", "host", CHALLENGE, ANSWER, host);
    token_proof("a token of some length", "brick", CHALLENGE, ANSWER, brick);
    token_proof("a token of some length", "host", CHALLENGE, ANSWER, again);
    TEST_ASSERT_TRUE(token_equal(host, again));
    TEST_ASSERT_FALSE(token_equal(host, brick));
    again[TOKEN_PROOF - 1] ^= 1;
    TEST_ASSERT_FALSE(token_equal(host, again));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_hmac_is_that_of_rfc_4231);
    RUN_TEST(test_a_text_may_end_anywhere_in_a_block);
    RUN_TEST(test_each_end_has_a_proof_of_its_own);
    return UNITY_END();
}
