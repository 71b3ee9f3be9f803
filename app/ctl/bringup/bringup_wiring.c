// SPDX-License-Identifier: MIT
// Names of the e-stop lines whose button was tested.
#include "bringup.h"

#include <stdio.h>
#include <string.h>

static const char *const keys[IWL_ESTOP_CONTACTS][2] = {{"chip", "chip_line"}, {"chip2", "chip2_line"}};

static int set(bringup_t *self, const char *name, const char *value, FILE *complaints) {
    char key[32];
    (void)snprintf(key, sizeof key, "estop.%s", name);
    return gateway_config_override(&self->config, key, value, "bringup", complaints);
}

void bringup_forget_wiring(bringup_t *self) {
    for (size_t i = 0; i < IWL_ESTOP_CONTACTS; i++) {
        (void)set(self, keys[i][0], "any", stderr);
        (void)set(self, keys[i][1], "any", stderr);
    }
}

static void store_contact(bringup_t *self, size_t contact, const char *line, FILE *nowhere) {
    iwl_estop_seen_t seen;
    if (strcmp(line, "none") == 0 || iwl_estop_see(line, &seen) != 0) {
        return;
    }
    const char *const found[] = {seen.chip, seen.line};
    for (size_t i = 0; i < sizeof found / sizeof found[0]; i++) {
        const char *key = keys[contact][i];
        if (found[i][0] != '\0' && set(self, key, found[i], nowhere) == 0) {
            bringup_note(self, "estop", key, NULL, "of the line on which press and release were seen");
        }
    }
}

void bringup_store_wiring(bringup_t *self) {
    FILE *const nowhere = fopen("/dev/null", "we");
    if (nowhere == NULL) {
        return;
    }
    store_contact(self, 0, self->config.estop.line, nowhere);
    store_contact(self, 1, self->config.estop.line2, nowhere);
    (void)fclose(nowhere);
}
