// SPDX-License-Identifier: MIT
#include "gpio_release.h"

void iw_gpio_release_init(iw_gpio_release_t *self, uint32_t debounce_us) {
    *self = (iw_gpio_release_t){.debounce_us = debounce_us};
}

/// A change of level without an edge counts as one: the kernel drops edges when its buffer is full.
void iw_gpio_release_see(iw_gpio_release_t *self, iw_time_us_t now_us, bool active, bool edge) {
    const bool disturbed = active || edge || self->active;
    self->edge = self->edge || edge || active != self->active;
    self->active = active;
    if (disturbed) {
        self->released_us = now_us + self->debounce_us;
    }
}

bool iw_gpio_release_take_pressed(iw_gpio_release_t *self, iw_time_us_t now_us) {
    const bool pressed = self->active || self->edge || now_us < self->released_us;
    self->edge = false;
    return pressed;
}

iw_time_us_t iw_gpio_release_next_us(const iw_gpio_release_t *self, iw_time_us_t now_us) {
    return (!self->active && now_us < self->released_us) ? self->released_us : IW_NEVER;
}
