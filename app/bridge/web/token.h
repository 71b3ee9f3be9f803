// SPDX-License-Identifier: MIT
/// Secret of the page: a file that only the bridge may read.
#ifndef WEB_TOKEN_H
#define WEB_TOKEN_H

#include "web_judge.h"

#include <stdio.h>
#include <time.h>

typedef struct {
    const char *path;
    uint32_t hours;  ///< Hours after which a new token is made; 0: never.
    bool only_reads; ///< Makes no token; root may read the file of any user.
    struct timespec made;
    char text[WEB_TOKEN_SIZE];
} web_token_t;

/// Reads the file, or makes it if it is missing or too old. Sets `*out_changed` if the token differs from before.
/// Returns false with a line on `err` if this fails or if other users could read the file; the token is then unchanged.
bool web_token_refresh(web_token_t *self, bool *out_changed, FILE *err);

/// Checks whether the start would refuse the file; makes and changes nothing. Also returns true if the start would make
/// a token. Returns false after a line on `err`.
bool web_token_judge(const web_token_t *self, FILE *err);

#endif
