// SPDX-License-Identifier: MIT
/// Between the two parts of answering a request: call.c (with HTTP) and web_ask.c (with the gateway).
#ifndef WEB_CALL_H
#define WEB_CALL_H

#include "web_server.h"

/// The message of a stop, or anything else, that found no gateway.
extern const char *const web_not_there;

/// An argument of the request's address; NULL: not given.
const char *web_call_argument(const web_call_t *self, const char *name);

/// Answers that it is refused, and counts it.
enum MHD_Result web_call_refuse(web_call_t *self, unsigned status, const char *error, const char *message);

/// Passes a judged request on to the gateway, or refuses it. The answer follows in `self->reply`.
enum MHD_Result web_call_ask(web_call_t *self);

#endif
