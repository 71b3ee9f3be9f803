// SPDX-License-Identifier: MIT
#include "report.h"

#include "bus_facts.h"

#include "iwheel_linux/clock.h"

#include <poll.h>
#include <stdarg.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/// How long the bus is listened to: ten periods of the slowest frame that always comes.
#define LISTEN_US 500000U

/// What was heard.
typedef struct {
    uint32_t speed[IW_SIDES];
    uint32_t foreign;
    uint32_t unknown;
    bool was_up;
    int estop;
} heard_t;

typedef struct {
    FILE *out;
    unsigned failed;
} verdicts_t;

__attribute__((format(printf, 3, 4))) static void say(verdicts_t *self, const char *verdict, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    (void)fprintf(self->out, "%-4s ", verdict);
    (void)vfprintf(self->out, format, arguments);
    (void)fputc('\n', self->out);
    va_end(arguments);
    self->failed += strcmp(verdict, "fail") == 0 ? 1U : 0U;
}

static void count(const iw_can_frame_t *frame, heard_t *heard) {
    iw_proto_message_t message;
    if (iw_proto_decode(frame, &message) != IW_OK) {
        ++heard->unknown;
    } else if (message.kind == IW_PROTO_SPEED) {
        ++heard->speed[message.side];
    } else if (message.kind == IW_PROTO_SETPOINT) {
        ++heard->foreign;
    }
}

static void listen_to_bus(gw_daemon_t *daemon, heard_t *out_heard) {
    const iw_hal_t hal = iw_linux_hal_functions(&daemon->hal);
    const iw_time_us_t end_us = iw_clock_now_us() + LISTEN_US;
    struct pollfd wait = {.fd = iw_linux_hal_bus_fd(&daemon->hal), .events = POLLIN};
    *out_heard = (heard_t){.estop = -1};
    for (iw_time_us_t now_us = iw_clock_now_us(); now_us < end_us; now_us = iw_clock_now_us()) {
        iw_can_frame_t frame;
        iw_linux_hal_tend(&daemon->hal, now_us);
        out_heard->was_up = hal.bus_state(hal.context) >= IW_BUS_PASSIVE || out_heard->was_up;
        out_heard->estop = hal.estop_pressed(hal.context);
        while (hal.receive(hal.context, &frame) > 0) {
            count(&frame, out_heard);
        }
        (void)poll(&wait, 1, 10);
    }
}

/// What the kernel tells of the interface; nothing for the local bus.
static void judge_link(const gw_daemon_t *daemon, verdicts_t *verdicts) {
    static const char *const words[] = {[GW_FACT_OK] = "ok", [GW_FACT_WARN] = "warn", [GW_FACT_FAIL] = "fail"};
    gw_fact_verdict_t verdict;
    char fact[GW_FACT_SIZE];
    for (unsigned i = 0; gw_bus_facts_tell(daemon, i, &verdict, fact); ++i) {
        if (fact[0] != '\0') {
            say(verdicts, words[verdict], "%s", fact);
        }
    }
}

static void judge_bus(const gw_daemon_t *daemon, const heard_t *heard, verdicts_t *verdicts) {
    const char *bus = daemon->config.bus.interface;
    const iw_link_presence_t presence = iw_linux_hal_link(&daemon->hal)->presence;
    judge_link(daemon, verdicts);
    if (!heard->was_up && presence == IW_LINK_LOCAL) {
        say(verdicts, "fail", "bus %s: nobody there; start the simulator: iwheel-sim --can %s", bus, bus);
    } else if (!heard->was_up && presence == IW_LINK_UP) {
        say(verdicts, "fail",
            "bus %s: bus-off; check cable, termination and bit rate, then: ip link set %s down; ip "
            "link set %s up",
            bus, bus, bus);
    }
    if (!heard->was_up) {
        return;
    }
    if (presence == IW_LINK_LOCAL) {
        say(verdicts, "ok", "bus %s: up", bus);
    }
    for (unsigned side = 0; side < IW_SIDES; ++side) {
        const char *name = side == IW_LEFT ? "left" : "right";
        if (heard->speed[side] == 0U) {
            say(verdicts, "fail", "%s wheel: not heard for %u ms; check its power, cable and termination", name,
                LISTEN_US / IW_US_PER_MS);
        } else {
            say(verdicts, "ok", "%s wheel: %u speed frames in %u ms", name, (unsigned)heard->speed[side],
                LISTEN_US / IW_US_PER_MS);
        }
    }
    if (heard->foreign > 0U) {
        say(verdicts, "fail",
            "somebody sends setpoints: %u frames with id 266 (0x10A) or 298 (0x12A); switch it off, or stop the "
            "gateway that does",
            (unsigned)heard->foreign);
    }
    if (heard->unknown > 0U) {
        say(verdicts, "warn", "%u frames are none of the wheels'; look with: iwheelctl watch frame",
            (unsigned)heard->unknown);
    }
}

static void judge_estop(const gw_daemon_t *daemon, const heard_t *heard, verdicts_t *verdicts) {
    const char *line = daemon->config.estop.line;
    if (!daemon->hal.estop_ops->present) {
        say(verdicts, "warn", "e-stop: none; wire a button and set [estop] line");
    } else if (heard->estop < 0) {
        say(verdicts, "fail", "e-stop %s: unreadable, which counts as pressed: %s", line,
            gw_report_estop_trouble(daemon));
    } else {
        say(verdicts, daemon->hal.estop_ops->simulated ? "warn" : "ok", "e-stop %s: %s%s", line,
            heard->estop > 0 ? "pressed" : "released",
            daemon->hal.estop_ops->simulated ? ", SIMULATED; wire a button before real wheels turn" : "");
    }
}

static void judge_config(const gateway_config_t *config, verdicts_t *verdicts) {
    if (config->core.setpoint_type_set && config->core.current_role != IW_ROLE_UNSET) {
        say(verdicts, "ok", "setpoint type %u, current role %s", config->core.setpoint_type,
            config->core.current_role == IW_ROLE_LIMIT ? "limit" : "setpoint");
    } else {
        say(verdicts, "fail", "%s%s%s not configured: arm will be refused; set it under [wheels] in the configuration",
            config->core.setpoint_type_set ? "" : "setpoint_type",
            !config->core.setpoint_type_set && config->core.current_role == IW_ROLE_UNSET ? " and " : "",
            config->core.current_role == IW_ROLE_UNSET ? "current_role" : "");
    }
    const iw_stop_budget_t budget = iw_config_stop_budget(&config->core);
    say(verdicts, "ok",
        "stop budget: client lost %u ms, %u mm; gateway killed %u ms, %u mm at full command, then unknown",
        (unsigned)budget.client_lost_ms, (unsigned)budget.client_lost_mm, (unsigned)budget.killed_ms,
        (unsigned)budget.killed_mm);
}

static void judge_socket(const gateway_config_t *config, verdicts_t *verdicts) {
    char directory[GATEWAY_PATH_SIZE];
    const char *path = config->northbound.socket;
    const char *slash = strrchr(path, '/');
    (void)snprintf(directory, sizeof directory, "%.*s", slash == NULL ? 1 : (int)(slash - path) + 1,
                   slash == NULL ? "." : path);
    if (access(directory, W_OK | X_OK) == 0) {
        say(verdicts, "ok", "socket %s: its directory is there", path);
    } else {
        say(verdicts, "fail", "socket %s: its directory cannot be written; make it: mkdir -p %s", path, directory);
    }
}

int gw_report_check(gw_daemon_t *daemon, FILE *out) {
    verdicts_t verdicts = {.out = out};
    heard_t heard;
    listen_to_bus(daemon, &heard);
    judge_config(&daemon->config, &verdicts);
    judge_socket(&daemon->config, &verdicts);
    judge_bus(daemon, &heard, &verdicts);
    judge_estop(daemon, &heard, &verdicts);
    return verdicts.failed > 0U ? 1 : 0;
}
