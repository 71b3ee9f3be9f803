// SPDX-License-Identifier: MIT
#include "gpio.h"

#include <ctype.h>
#include <errno.h>
#include <string.h>

#define OFFSET_MAX 65535U

static const char chip_prefix[] = "gpiochip";

/// Reads digits up to the end of the text or to `end`. Returns NULL if there are none or too many.
static const char *read_number(const char *text, char end, unsigned *out_number) {
    unsigned number = 0;
    const char *digit = text;
    for (; isdigit((unsigned char)*digit) != 0 && number <= OFFSET_MAX; digit++) {
        number = number * 10U + (unsigned)(*digit - '0');
    }
    if (digit == text || *digit != end || number > OFFSET_MAX) {
        return NULL;
    }
    *out_number = number;
    return digit;
}

int iwl_gpio_address_parse(const char *text, iwl_gpio_address_t *out_address) {
    iwl_gpio_address_t address = {.by_offset = strncmp(text, chip_prefix, sizeof chip_prefix - 1U) == 0 &&
                                               strchr(text, ':') != NULL};
    size_t length = strlen(text);
    // Names of lines may contain a colon. Only a name that also begins like a chip is an address by offset.
    if (address.by_offset) {
        unsigned chip;
        const char *colon = read_number(text + sizeof chip_prefix - 1U, ':', &chip);
        if (colon == NULL || read_number(colon + 1, '\0', &address.offset) == NULL) {
            return EINVAL;
        }
        length = (size_t)(colon - text);
    }
    if (length == 0U) {
        return EINVAL;
    }
    if (length >= sizeof address.name) {
        return ENAMETOOLONG;
    }
    memcpy(address.name, text, length);
    *out_address = address;
    return 0;
}

void iwl_gpio_note(iwl_estop_seen_t *out_seen, const char *chip, const char *line) {
    const struct {
        char *to;
        const char *from;
    } names[] = {{out_seen->chip, chip}, {out_seen->line, line}};
    memset(out_seen, 0, sizeof *out_seen);
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        const size_t length = (names[i].from != NULL) ? strlen(names[i].from) : 0U;
        memcpy(names[i].to, (length > 0U) ? names[i].from : "", (length < IWL_GPIO_NAME_SIZE) ? length : 0U);
    }
}

void iwl_gpio_place(iwl_estop_seen_t *out_seen, const char *node, unsigned offset) {
    const size_t length = (node != NULL) ? strlen(node) : 0U;
    memcpy(out_seen->node, (length > 0U) ? node : "", (length < IWL_GPIO_NAME_SIZE) ? length : 0U);
    out_seen->offset = offset;
}

bool iwl_gpio_is_expected(const iwl_gpio_address_t *address, const iwl_estop_seen_t *seen) {
    const iwl_estop_seen_t *expected = &address->expected;
    return (expected->chip[0] == '\0' || strcmp(expected->chip, seen->chip) == 0) &&
           (expected->line[0] == '\0' || strcmp(expected->line, seen->line) == 0);
}

void iwl_gpio_release_init(iwl_gpio_release_t *self, uint32_t debounce_us) {
    *self = (iwl_gpio_release_t){.debounce_us = debounce_us};
}

/// A change of level without an edge counts as an edge, because the kernel drops edges when its buffer is full.
void iwl_gpio_release_see(iwl_gpio_release_t *self, iw_time_us_t now_us, bool active, bool edge) {
    const bool disturbed = active || edge || self->active;
    self->edge = self->edge || edge || active != self->active;
    self->active = active;
    if (disturbed) {
        self->released_us = now_us + self->debounce_us;
    }
}

bool iwl_gpio_release_take_pressed(iwl_gpio_release_t *self, iw_time_us_t now_us) {
    const bool pressed = self->active || self->edge || now_us < self->released_us;
    self->edge = false;
    return pressed;
}

iw_time_us_t iwl_gpio_release_next_us(const iwl_gpio_release_t *self, iw_time_us_t now_us) {
    return (!self->active && now_us < self->released_us) ? self->released_us : IW_NEVER;
}
