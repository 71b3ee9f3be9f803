// SPDX-License-Identifier: MIT
#include "bus_facts.h"

#include "wheels/wheels.h"

#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <unistd.h>

#define PATH_SIZE 256

static iwl_timing_t judge(const inspect_config_t *config, const iwl_bus_link_t *link) {
    return iwl_timing_judge(link, config->bitrate_hz, config->sample_point_permille);
}

const char *gw_bus_facts_timing(const inspect_config_t *config, const iwl_bus_link_t *link) {
    switch (judge(config, link)) {
    case IWL_TIMING_RIGHT:
        return "confirmed";
    case IWL_TIMING_NEAR:
        return "near";
    case IWL_TIMING_WRONG:
        return "contradicted";
    default:
        return "unproven";
    }
}

__attribute__((format(printf, 2, 3))) static void warn(gw_wheels_t *wheels, const char *format, ...) {
    va_list arguments;
    if (wheels->warnings < GW_WARNINGS) {
        va_start(arguments, format);
        (void)vsnprintf(wheels->warning[wheels->warnings], GW_WARNING_SIZE, format, arguments);
        va_end(arguments);
        wheels->warnings++;
    }
}

static void warn_of_health(gw_wheels_t *wheels) {
    const iw_snapshot_t seen = gw_wheels_snapshot(wheels);
    char sentence[GW_WARNING_SIZE];
    for (unsigned i = 0; i < (unsigned)IW_SIDES * GW_AILMENTS; i++) {
        const iw_side_t side = (iw_side_t)(i / GW_AILMENTS);
        const gw_ailment_t ailment = (gw_ailment_t)(i % GW_AILMENTS);
        if (wheels->health.present[side][ailment]) {
            gw_health_sentence(&wheels->health, &seen, side, ailment, sentence);
            warn(wheels, "%s", sentence);
        }
    }
}

static void note_warnings(gw_wheels_t *wheels, bool left_behind) {
    const iwl_hal_t *hal = &wheels->hal;
    char sentence[GW_WARNING_SIZE];
    wheels->warnings = 0;
    if (!hal->estop_ops->present) {
        warn(wheels, "there is no e-stop line: only software and the wheels' own 1 s watchdog can stop the wheels; "
                     "configure [estop] line");
    } else if (hal->estop_ops->simulated) {
        warn(wheels, "the e-stop %s is SIMULATED: no button of this machine stops the wheels", wheels->estop);
    }
    warn_of_health(wheels);
    if (wheels->estop_untried) {
        warn(wheels, GW_ESTOP_UNTRIED, wheels->estop);
    }
    if (left_behind) {
        gw_bus_left_sentence(iwl_hal_link(hal), wheels->bus.name, sentence, sizeof sentence);
        warn(wheels, "%s", sentence);
    }
    static inspect_findings_t findings; // Too large for a stack.
    inspect_begin(&findings);
    inspect_link(iwl_hal_link(hal), &wheels->bus, &findings);
    for (unsigned i = 0; i < findings.count; i++) {
        if (findings.finding[i].verdict != INSPECT_OK) {
            inspect_sentence(&findings.finding[i], sentence, sizeof sentence);
            warn(wheels, "%s", sentence);
        }
    }
}

void gw_bus_facts_follow(gw_bus_facts_t *self, gw_wheels_t *wheels, bool left_behind) {
    const iwl_bus_link_t *link = iwl_hal_link(&wheels->hal);
    const bool news = !self->known || link->changes != self->changes;
    if (!news && left_behind == self->left_behind && wheels->estop_untried == self->untried &&
        wheels->health.changes == self->health) {
        return;
    }
    if (news) {
        const iw_bus_facts_t facts = {.timing_contradicted =
                                          wheels->bus.refuses && judge(&wheels->bus, link) == IWL_TIMING_WRONG,
                                      .echo_proven = link->echo_proven};
        self->known = true;
        self->changes = link->changes;
        iw_gateway_bus_facts(&wheels->core, &facts);
        gw_tape_facts(&wheels->tape, wheels->now_us, &facts);
    }
    self->left_behind = left_behind;
    self->untried = wheels->estop_untried;
    self->health = wheels->health.changes;
    note_warnings(wheels, left_behind);
}

void gw_bus_left_sentence(const iwl_bus_link_t *link, const char *bus, char *out_sentence, size_t size) {
    static const char what[] = "a setpoint is still in the controller and may be sent when wheels get power";
    if (link->presence == IWL_LINK_LOCAL) {
        (void)snprintf(out_sentence, size, "bus %s: %s; start its hub (the simulator) again", bus, what);
    } else if (!link->echo_proven) {
        (void)snprintf(out_sentence, size, "bus %s: %s; this adapter cannot be emptied: switch it off and on", bus,
                       what);
    } else {
        (void)snprintf(out_sentence, size,
                       "bus %s: %s; empty it: ip link set %s down; ip link set %s up (or let the service do it: "
                       "systemctl enable --now iwheel-can-restart@%s.path)",
                       bus, what, bus, bus, bus);
    }
}

bool gw_bus_left_ask(const char *directory, const char *interface) {
    static const char text[] = "restart\n";
    char path[PATH_SIZE];
    if (snprintf(path, sizeof path, "%s/%s.restart", directory, interface) >= (int)sizeof path) {
        return false;
    }
    (void)unlink(path); // Created again, so that nothing is written through a link.
    const int fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
    if (fd < 0) {
        return false;
    }
    const bool written = write(fd, text, sizeof text - 1U) == (ssize_t)(sizeof text - 1U);
    return (close(fd) == 0) && written;
}
