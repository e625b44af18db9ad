/* token.h: how both ends of a connection prove that they were given the same token, without sending it.
 *
 * The brick sends a challenge of random digits. The host answers with own digits and with token_proof("host", ...) of
 * both digits; the brick answers with token_proof("brick", ...). A proof is HMAC-SHA-256 (RFC 2104, FIPS 180-4) in
 * hexadecimal.
 */
#ifndef BRICKPILOT_BRICK_TOKEN_H
#define BRICKPILOT_BRICK_TOKEN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { TOKEN_LEAST = 16, TOKEN_MOST = 64, TOKEN_DIGITS = 32, TOKEN_PROOF = 64, TOKEN_TEXT_MOST = 128 };

/* Writes each byte as two lower-case hexadecimal digits, and a 0 at the end. */
void token_digits(const uint8_t *bytes, size_t size, char *digits);

/* HMAC-SHA-256 of `text`, of at most TOKEN_TEXT_MOST bytes, with a key of at most TOKEN_MOST bytes. */
void token_hmac(const char *key, const char *text, uint8_t out[32]);

/* The proof of `who` ("host" or "brick"): the HMAC of who, challenge and answer (TOKEN_DIGITS digits each). */
void token_proof(const char *token, const char *who, const char *challenge, const char *answer,
                 char proof[TOKEN_PROOF + 1]);

/* True if the TOKEN_PROOF bytes are equal. Takes the same time wherever the first difference is. */
bool token_equal(const char *a, const char *b);

#endif
