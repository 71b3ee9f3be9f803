// SPDX-License-Identifier: MIT
/// Texts of a configuration file of the gateway, and the messages about them.
#ifndef TEST_CONFIG_RIG_H
#define TEST_CONFIG_RIG_H

#include "config/gateway_config.h"

#include <stddef.h>
#include <stdio.h>

extern char messages[8192];     ///< Messages of the last call.
extern gateway_config_t config; ///< Result of the last call.
extern gateway_config_t before; ///< Its content before that call.

/// Parses this text into a poisoned configuration.
int parse_bytes(const char *text, size_t size);
int parse(const char *text);

/// Loads this file into a poisoned configuration.
int load(const char *path);

/// Changes one key of the configuration.
int override(const char *name, const char *value);

/// Checks that the text is accepted without a message.
void accepted(const char *text);

/// Checks that the text is refused, that nothing is applied, and that the messages contain both strings.
void refused(const char *text, const char *where, const char *what);

/// Returns the printed configuration; the caller frees it.
char *printed(const gateway_config_t *from);

#endif
