#include "brick/token.h"

#include <stdio.h>
#include <string.h>

enum { BLOCK = 64, HASH = 32, LENGTH_AT = 56 };

static const uint32_t ROUNDS[BLOCK] = {
    0x428a2f98U, 0x71374491U, 0xb5c0fbcfU, 0xe9b5dba5U, 0x3956c25bU, 0x59f111f1U, 0x923f82a4U, 0xab1c5ed5U,
    0xd807aa98U, 0x12835b01U, 0x243185beU, 0x550c7dc3U, 0x72be5d74U, 0x80deb1feU, 0x9bdc06a7U, 0xc19bf174U,
    0xe49b69c1U, 0xefbe4786U, 0x0fc19dc6U, 0x240ca1ccU, 0x2de92c6fU, 0x4a7484aaU, 0x5cb0a9dcU, 0x76f988daU,
    0x983e5152U, 0xa831c66dU, 0xb00327c8U, 0xbf597fc7U, 0xc6e00bf3U, 0xd5a79147U, 0x06ca6351U, 0x14292967U,
    0x27b70a85U, 0x2e1b2138U, 0x4d2c6dfcU, 0x53380d13U, 0x650a7354U, 0x766a0abbU, 0x81c2c92eU, 0x92722c85U,
    0xa2bfe8a1U, 0xa81a664bU, 0xc24b8b70U, 0xc76c51a3U, 0xd192e819U, 0xd6990624U, 0xf40e3585U, 0x106aa070U,
    0x19a4c116U, 0x1e376c08U, 0x2748774cU, 0x34b0bcb5U, 0x391c0cb3U, 0x4ed8aa4aU, 0x5b9cca4fU, 0x682e6ff3U,
    0x748f82eeU, 0x78a5636fU, 0x84c87814U, 0x8cc70208U, 0x90befffaU, 0xa4506cebU, 0xbef9a3f7U, 0xc67178f2U};

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

/* SHA-256 of a block followed by `size` bytes of text, at most TOKEN_TEXT_MOST. */
static void hash(const uint8_t *block, const uint8_t *text, size_t size, uint8_t out[HASH])
{
    uint32_t state[8] = {0x6a09e667U, 0xbb67ae85U, 0x3c6ef372U, 0xa54ff53aU,
                         0x510e527fU, 0x9b05688cU, 0x1f83d9abU, 0x5be0cd19U};
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
