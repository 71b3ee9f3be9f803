// SPDX-License-Identifier: MIT
/// Interface between the two parts of answering a request: call.c (HTTP) and web_ask.c (gateway).
#ifndef WEB_CALL_H
#define WEB_CALL_H

#include "web_server.h"

/// Message of a stop, or of another request, if there is no gateway.
extern const char *const web_not_there;

/// Returns an argument of the request address; NULL if it is absent.
const char *web_call_argument(const web_call_t *self, const char *name);

/// Answers that the request is refused, and counts it.
enum MHD_Result web_call_refuse(web_call_t *self, unsigned status, const char *error, const char *message);

/// Passes a judged request on to the gateway, or refuses it. The answer follows in `self->reply`.
enum MHD_Result web_call_ask(web_call_t *self);

#endif
