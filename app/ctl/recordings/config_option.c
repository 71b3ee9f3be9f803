// SPDX-License-Identifier: MIT
#include "config_option.h"

#include "gateway_config.h"
#include "talk/ctl.h"

int config_option_load(const char *verb, const char *path, iw_config_t *out_config) {
    gateway_config_t config;
    if (path == NULL) {
        return ctl_fail(CTL_USAGE, "--config wants the gateway's configuration file; see: iwheelctl %s --help", verb);
    }
    if (gateway_config_load(path, &config, stderr) != 0) {
        return CTL_CONFIG;
    }
    *out_config = config.core;
    return CTL_OK;
}
