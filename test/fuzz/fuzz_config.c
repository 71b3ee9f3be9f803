// SPDX-License-Identifier: MIT
// Any bytes as a configuration file: refused with a message and no change, or accepted, and the same after printing and reading.
#include "fuzz.h"

#include "config/gateway_config.h"

static void judge_accepted(const gateway_config_t *config, FILE *null) {
    static char printed[GATEWAY_CONFIG_FILE_MAX];
    static gateway_config_t again;
    FILE *const out = fmemopen(printed, sizeof printed, "w");
    fuzz_require(iw_config_check(&config->core) == IW_CONFIG_OK, "the core accepts the configuration");
    fuzz_require(memchr(config->bus.interface, '\0', sizeof config->bus.interface) != NULL &&
                     memchr(config->estop.line, '\0', sizeof config->estop.line) != NULL &&
                     memchr(config->northbound.socket, '\0', sizeof config->northbound.socket) != NULL,
                 "texts end");
    gateway_config_print(config, out);
    (void)fclose(out);
    fuzz_require(gateway_config_parse("again", printed, strlen(printed), &again, null) == 0,
                 "the printed text is accepted");
    fuzz_require(memcmp(&again.core, &config->core, sizeof again.core) == 0, "and has the same values");
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static gateway_config_t config;
    static gateway_config_t before;
    static char messages[65536];
    FILE *const err = fmemopen(messages, sizeof messages, "w");
    memset(&config, 0, sizeof config);
    before = config;
    const int result = gateway_config_parse("fuzz.conf", (const char *)data, size, &config, err);
    const long length = ftell(err);
    fuzz_position((result == 0) ? "accepted" : "refused");
    if (result == 0) {
        judge_accepted(&config, err);
    } else {
        fuzz_require(length > 0, "a refusal has a message");
        fuzz_require(memcmp(&before, &config, sizeof config) == 0, "and changes nothing");
    }
    (void)fclose(err);
    return 0;
}
