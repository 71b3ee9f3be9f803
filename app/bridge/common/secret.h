// SPDX-License-Identifier: MIT
/// Secrets of 128 random bits, written as 32 lower-case hexadecimal digits.
#ifndef BRIDGE_SECRET_H
#define BRIDGE_SECRET_H

#include <stdbool.h>

/// Bytes of a secret with its terminator.
#define BRIDGE_SECRET_SIZE 33U

/// A new secret from getrandom(). False: the kernel gives none, and `out` is empty.
bool bridge_secret_draw(char out[BRIDGE_SECRET_SIZE]);

/// True if both texts are equal and not empty. The time does not depend on where they differ.
bool bridge_secret_is(const char *secret, const char *given);

#endif
