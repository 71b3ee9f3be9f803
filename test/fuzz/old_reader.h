// SPDX-License-Identifier: MIT
/// The reader of requests that stood on jansson: the oracle of what iwn_request_read accepts and refuses, and in which words.
#ifndef FUZZ_OLD_READER_H
#define FUZZ_OLD_READER_H

#include "iwheel_northbound/request.h"

/// As iwn_request_read. It drops a NUL behind a number or a word without a sound, which it should refuse.
bool old_request_read(const char *line, size_t length, iwn_request_t *out_request, iwn_refusal_t *out_refusal);

#endif
