// SPDX-License-Identifier: MIT
// What the line is called whose button was seen to work.
#include "bringup.h"

#include <stdio.h>

void bringup_forget_wiring(bringup_t *self) {
    (void)gateway_config_override(&self->config, "estop.chip", "any", "bringup", stderr);
    (void)gateway_config_override(&self->config, "estop.chip_line", "any", "bringup", stderr);
}

void bringup_store_wiring(bringup_t *self) {
    iw_estop_seen_t seen;
    FILE *const nowhere = fopen("/dev/null", "we");
    if (nowhere == NULL || iw_estop_see(self->config.estop.line, &seen) != 0) {
        seen = (iw_estop_seen_t){.chip = ""};
    }
    const char *const found[][2] = {{"chip", seen.chip}, {"chip_line", seen.line}};
    for (size_t i = 0; i < sizeof found / sizeof found[0]; i++) {
        char key[32];
        (void)snprintf(key, sizeof key, "estop.%s", found[i][0]);
        if (found[i][1][0] != '\0' &&
            gateway_config_override(&self->config, key, found[i][1], "bringup", nowhere) == 0) {
            bringup_note(self, "estop", found[i][0], NULL, "of the line whose press and release were seen");
        }
    }
    if (nowhere != NULL) {
        (void)fclose(nowhere);
    }
}
