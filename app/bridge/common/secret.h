// SPDX-License-Identifier: MIT
/// Secrets of 128 random bits, written as 32 lower-case hexadecimal digits.
#ifndef BRIDGE_SECRET_H
#define BRIDGE_SECRET_H

#include <stdbool.h>

/// Size of a secret with its terminator.
#define BRIDGE_SECRET_SIZE 33U

/// Draws a new secret from getrandom(). Returns false and sets `out` empty if the kernel returns no random bytes.
bool bridge_secret_draw(char out[BRIDGE_SECRET_SIZE]);

/// Returns true if both texts are equal and not empty. The time does not depend on the position of a difference.
bool bridge_secret_is(const char *secret, const char *candidate);

#endif
