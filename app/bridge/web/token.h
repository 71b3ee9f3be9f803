// SPDX-License-Identifier: MIT
/// The secret of the page: a file that only the bridge may read.
#ifndef WEB_TOKEN_H
#define WEB_TOKEN_H

#include "web_judge.h"

#include <stdio.h>
#include <time.h>

typedef struct {
    const char *path;
    uint32_t hours;  ///< After which another one is made; 0: never.
    bool only_reads; ///< Makes none; root may read anybody's.
    struct timespec made;
    char text[WEB_TOKEN_SIZE];
} web_token_t;

/// Reads the file, or makes it if it is not there or too old; `*out_changed`: the token is another than before. False, with a line on
/// `err`, if that fails or if others could read it; the token is as before then.
bool web_token_refresh(web_token_t *self, bool *out_changed, FILE *err);

/// Whether the start would refuse what the file holds; makes and changes nothing. True too where the start would make a token. False after
/// a line on `err`.
bool web_token_judge(const web_token_t *self, FILE *err);

#endif
