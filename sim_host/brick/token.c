#include "brick/token.h"

#include <stdio.h>
#include <string.h>

enum { BLOCK = 64, HASH = 32, LENGTH_AT = 56 };

static const uint32_t ROUNDS[BLOCK] = {
    0x428a2f98, 0x71374491, 0xb5c0fbcf, 0xe9b5dba5, 0x3956c25b, 0x59f111f1, 0x923f82a4, 0xab1c5ed5,
    0xd807aa98, 0x12835b01, 0x243185be, 0x550c7dc3, 0x72be5d74, 0x80deb1fe, 0x9bdc06a7, 0xc19bf174,
    0xe49b69c1, 0xefbe4786, 0x0fc19dc6, 0x240ca1cc, 0x2de92c6f, 0x4a7484aa, 0x5cb0a9dc, 0x76f988da,
    0x983e5152, 0xa831c66d, 0xb00327c8, 0xbf597fc7, 0xc6e00bf3, 0xd5a79147, 0x06ca6351, 0x14292967,
    0x27b70a85, 0x2e1b2138, 0x4d2c6dfc, 0x53380d13, 0x650a7354, 0x766a0abb, 0x81c2c92e, 0x92722c85,
    0xa2bfe8a1, 0xa81a664b, 0xc24b8b70, 0xc76c51a3, 0xd192e819, 0xd6990624, 0xf40e3585, 0x106aa070,
    0x19a4c116, 0x1e376c08, 0x2748774c, 0x34b0bcb5, 0x391c0cb3, 0x4ed8aa4a, 0x5b9cca4f, 0x682e6ff3,
    0x748f82ee, 0x78a5636f, 0x84c87814, 0x8cc70208, 0x90befffa, 0xa4506ceb, 0xbef9a3f7, 0xc67178f2};

static uint32_t rotated(uint32_t word, unsigned bits)
{
    return word >> bits | word << (32U - bits);
}

static void take_block(uint32_t state[8], const uint8_t *block)
{
    uint32_t w[BLOCK], s[8];

    for (int i = 0; i < 16; i++)
        w[i] = (uint32_t)block[4 * i] << 24 | (uint32_t)block[4 * i + 1] << 16 | (uint32_t)block[4 * i + 2] << 8 |
               block[4 * i + 3];
    for (int i = 16; i < BLOCK; i++) {
        const uint32_t a = w[i - 15], b = w[i - 2];
        w[i] = w[i - 16] + (rotated(a, 7) ^ rotated(a, 18) ^ a >> 3) + w[i - 7] +
               (rotated(b, 17) ^ rotated(b, 19) ^ b >> 10);
    }
    memcpy(s, state, sizeof s);
    for (int i = 0; i < BLOCK; i++) {
        const uint32_t chosen = (s[4] & s[5]) ^ (~s[4] & s[6]);
        const uint32_t majority = (s[0] & s[1]) ^ (s[0] & s[2]) ^ (s[1] & s[2]);
        const uint32_t one =
            s[7] + (rotated(s[4], 6) ^ rotated(s[4], 11) ^ rotated(s[4], 25)) + chosen + ROUNDS[i] + w[i];
        const uint32_t two = (rotated(s[0], 2) ^ rotated(s[0], 13) ^ rotated(s[0], 22)) + majority;
        memmove(s + 1, s, 7 * sizeof s[0]);
        s[4] += one;
        s[0] = one + two;
    }
    for (int i = 0; i < 8; i++)
        state[i] += s[i];
}

/* SHA-256 of a block and of `size` bytes of text, at most TOKEN_TEXT_MOST. */
static void hash(const uint8_t *block, const uint8_t *text, size_t size, uint8_t out[HASH])
{
    uint32_t state[8] = {0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                         0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
    uint8_t rest[3 * BLOCK] = {0};
    const size_t blocks = size / BLOCK + (size % BLOCK < LENGTH_AT ? 1 : 2);
    const size_t bits = 8 * (BLOCK + size);

    memcpy(rest, text, size);
    rest[size] = 0x80;
    rest[BLOCK * blocks - 2] = (uint8_t)(bits >> 8);
    rest[BLOCK * blocks - 1] = (uint8_t)bits;
    take_block(state, block);
    for (size_t i = 0; i < blocks; i++)
        take_block(state, rest + BLOCK * i);
    for (int i = 0; i < HASH; i++)
        out[i] = (uint8_t)(state[i / 4] >> (24 - 8 * (i % 4)));
}

static void set_pad(uint8_t pad[BLOCK], const char *key, uint8_t with)
{
    const size_t size = strlen(key);

    for (size_t i = 0; i < BLOCK; i++)
        pad[i] = (uint8_t)((i < size ? (uint8_t)key[i] : 0U) ^ with);
}

void token_hmac(const char *key, const char *text, uint8_t out[HASH])
{
    uint8_t pad[BLOCK], inner[HASH];

    set_pad(pad, key, 0x36);
    hash(pad, (const uint8_t *)text, strlen(text), inner);
    set_pad(pad, key, 0x5c);
    hash(pad, inner, HASH, out);
}

void token_digits(const uint8_t *bytes, size_t size, char *digits)
{
    for (size_t i = 0; i < size; i++)
        snprintf(digits + 2 * i, 3, "%02x", bytes[i]);
}

void token_proof(const char *token, const char *who, const char *challenge, const char *answer,
                 char proof[TOKEN_PROOF + 1])
{
    char text[TOKEN_TEXT_MOST + 1];
    uint8_t mac[HASH];

    snprintf(text, sizeof text, "%s %.32s%.32s", who, challenge, answer);
    token_hmac(token, text, mac);
    token_digits(mac, HASH, proof);
}

bool token_equal(const char *a, const char *b)
{
    unsigned different = 0;

    for (int i = 0; i < TOKEN_PROOF; i++)
        different |= (unsigned)(a[i] ^ b[i]);
    return different == 0;
}
