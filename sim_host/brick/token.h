/* token.h: how both ends of a connection prove that they were given the same token, without sending it.
 *
 * The brick sends a challenge of random digits; the host answers with digits of its own and token_proof("host", ...) of
 * both; the brick answers with token_proof("brick", ...). A proof is HMAC-SHA-256 (RFC 2104, FIPS 180-4) in hexadecimal.
 */
#ifndef BRICKPILOT_BRICK_TOKEN_H
#define BRICKPILOT_BRICK_TOKEN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { TOKEN_LEAST = 16, TOKEN_MOST = 64, TOKEN_DIGITS = 32, TOKEN_PROOF = 64, TOKEN_TEXT_MOST = 128 };

/* Writes bytes as two lower-case digits each, and a 0 behind them. */
void token_digits(const uint8_t *bytes, size_t size, char *digits);

/* HMAC-SHA-256 of `text`, of at most TOKEN_TEXT_MOST bytes, with a key of at most TOKEN_MOST bytes. */
void token_hmac(const char *key, const char *text, uint8_t out[32]);

/* The proof of `who` ("host" or "brick"): the HMAC of who, challenge and answer (TOKEN_DIGITS digits each). */
void token_proof(const char *token, const char *who, const char *challenge, const char *answer,
                 char proof[TOKEN_PROOF + 1]);

/* True where TOKEN_PROOF bytes are equal; takes the same time wherever they differ. */
bool token_equal(const char *a, const char *b);

#endif
