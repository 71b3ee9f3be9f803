// SPDX-License-Identifier: MIT
#include "config_option.h"

#include "gateway_config.h"
#include "talk/ctl.h"

#include <errno.h>
#include <string.h>
#include <unistd.h>

int config_option_load(const option_t *option, const char *verb, const char *path) {
    gateway_config_t config;
    if (path == NULL) {
        return ctl_fail(CTL_USAGE, "--config wants the gateway's configuration file; see: iwheelctl %s --help", verb);
    }
    if (gateway_config_load(path, &config, stderr) != 0) {
        return CTL_CONFIG;
    }
    *(iw_config_t *)option->out = config.core;
    return CTL_OK;
}

int config_option_take(const char *path, int fd, iw_config_t *out_config) {
    static char text[GATEWAY_CONFIG_FILE_MAX + 1U];
    gateway_config_t config;
    size_t size = 0;
    ssize_t got = 1;
    while (got > 0 && size < sizeof text) {
        got = read(fd, text + size, sizeof text - size);
        size += (got > 0) ? (size_t)got : 0U;
    }
    const int error = errno;
    (void)close(fd);
    if (got < 0 || size == sizeof text) {
        return ctl_fail(CTL_CONFIG, "%s: cannot be read: %s", path, (got < 0) ? strerror(error) : "it is too long");
    }
    if (gateway_config_parse(path, text, size, &config, stderr) != 0) {
        return CTL_CONFIG;
    }
    *out_config = config.core;
    return CTL_OK;
}
