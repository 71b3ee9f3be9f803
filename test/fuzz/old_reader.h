// SPDX-License-Identifier: MIT
/// The earlier reader of requests on jansson: the oracle for what iwn_request_read accepts and refuses, and for the texts of refusals.
#ifndef FUZZ_OLD_READER_H
#define FUZZ_OLD_READER_H

#include "iwheel_northbound/request.h"

/// As iwn_request_read. It drops a NUL after a number or a word without a refusal, which it should refuse.
bool old_request_read(const char *line, size_t length, iwn_request_t *out_request, iwn_refusal_t *out_refusal);

#endif
