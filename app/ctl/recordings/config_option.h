// SPDX-License-Identifier: MIT
/// The option --config FILE of the verbs that read recordings.
#ifndef CONFIG_OPTION_H
#define CONFIG_OPTION_H

#include "talk/words.h"

#include "iwheel/config.h"

/// Reads the gateway's configuration at `path` into the iw_config_t of the option. An exit code; what is wrong has been told.
int config_option_load(const option_t *option, const char *verb, const char *path);

/// The same of a file that is open, which it closes; `path` is its name in messages.
int config_option_take(const char *path, int fd, iw_config_t *out_config);

#endif
