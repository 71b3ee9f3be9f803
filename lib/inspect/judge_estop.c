// SPDX-License-Identifier: MIT
#include "inspect.h"

#include <errno.h>
#include <glob.h>
#include <string.h>

/// Name of a bus without any node, to open an e-stop without a bus.
#define NO_BUS "unix:/dev/null/none"

static bool has_gpio(void) {
    glob_t found;
    const bool any = glob("/dev/gpiochip*", GLOB_NOSORT, NULL, &found) == 0;
    globfree(&found);
    return any;
}

const char *inspect_estop_trouble(const iwl_hal_t *hal) {
    const int first = iwl_hal_estop_trouble(hal, 0);
    const int trouble = (first != 0) ? first : iwl_hal_estop_trouble(hal, 1);
    if (trouble == 0) {
        return "";
    }
    if (hal->estop_ops->simulated) {
        return "the simulator is not there; start it with this --estop";
    }
    switch (trouble) {
    case ENOENT:
        return has_gpio() ? "there is no such line; gpioinfo lists them"
                          : "this machine has no GPIO chip (/dev/gpiochip*): load its driver, or use another input";
    case ENOTUNIQ:
        return "two lines have this name; set [estop] line or line2 to gpiochipN:OFFSET of the wired one (gpioinfo "
               "lists them)";
    case EREMCHG:
        return (first != 0)
                   ? "the line belongs to another chip, or has another name, than [estop] chip and chip_line: find "
                     "the wired one (gpiodetect, gpioinfo), correct [estop], and try its button: iwheelctl doctor"
                   : "line2 belongs to another chip, or has another name, than [estop] chip2 and chip2_line: find "
                     "the wired one (gpiodetect, gpioinfo), correct [estop], and try its button: iwheelctl doctor";
    case EBUSY:
        return "the line is busy: another program has it; gpioinfo names that program";
    case EACCES:
    case EPERM:
        return "not allowed; add the gateway's user to the group that owns /dev/gpiochip*";
    default:
        return "its chip is gone or does not answer; gpiodetect lists the chips";
    }
}

const char *inspect_pressed_at(const iwl_hal_t *hal) {
    static const char *const names[] = {"neither", "line", "line2", "both"};
    const unsigned first = (hal->contact_last[0] != 0) ? 1U : 0U;
    return names[first + ((hal->contact_last[1] != 0) ? 2U : 0U)];
}

inspect_estop_t inspect_estop_of(const iwl_hal_t *hal, const char *line) {
    return (inspect_estop_t){
        .line = line,
        .pressed_at = hal->two_contacts ? inspect_pressed_at(hal) : NULL,
        .present = hal->estop_ops->present,
        .simulated = hal->estop_ops->simulated,
        .level = hal->estop_last,
        .trouble = inspect_estop_trouble(hal),
        .no_gpio = hal->estop_ops->present && !hal->estop_ops->simulated && !has_gpio(),
    };
}

void inspect_estop(const inspect_estop_t *estop, inspect_findings_t *findings) {
    if (!estop->present) {
        inspect_add(findings, "estop", INSPECT_WARN, "e-stop: none");
        inspect_fix(findings, "wire a button and set [estop] line");
    } else if (estop->level < 0) {
        inspect_add(findings, "estop", estop->no_gpio ? findings->absent : INSPECT_FAIL,
                    "e-stop %s: unreadable%s%s, which counts as pressed", estop->line,
                    (estop->pressed_at != NULL) ? " at " : "", (estop->pressed_at != NULL) ? estop->pressed_at : "");
        inspect_fix(findings, "%s", estop->trouble);
    } else if (estop->level == IW_ESTOP_DISAGREES) {
        inspect_add(findings, "estop", INSPECT_FAIL, "e-stop %s: its two contacts disagree, pressed at %s", estop->line,
                    (estop->pressed_at != NULL) ? estop->pressed_at : "one");
        inspect_fix(findings, "fix contact or wire, press and release the button");
    } else {
        const bool where = estop->level > 0 && estop->pressed_at != NULL;
        inspect_add(findings, "estop", estop->simulated ? INSPECT_WARN : INSPECT_OK, "e-stop %s: %s%s%s%s", estop->line,
                    (estop->level > 0) ? "pressed" : "released", where ? " at " : "", where ? estop->pressed_at : "",
                    estop->simulated ? ", SIMULATED" : "");
        if (estop->simulated) {
            inspect_fix(findings, "wire a button before real wheels turn");
        }
    }
}

void inspect_unopened(const char *cause, bool is_bus, int error, inspect_findings_t *findings) {
    const char *check = is_bus ? "interface" : "estop";
    const char *what = is_bus ? "bus" : "e-stop";
    if (error == ENOTSUP) {
        inspect_add(findings, check, findings->absent,
                    "%s %s: %s was missing when this was built, so it %s only (unix:PATH)", what, cause,
                    is_bus ? "libmnl" : "libgpiod",
                    is_bus ? "serves the simulator's bus" : "reads the simulator's button");
        inspect_fix(findings, "apt-get install %s, configure and build again", is_bus ? "libmnl-dev" : "libgpiod-dev");
    } else if (error == ENOTUNIQ && !is_bus) {
        inspect_add(findings, check, INSPECT_FAIL,
                    "e-stop %s: [estop] line and line2 are the same line, so there is no second contact", cause);
        inspect_fix(findings, "write the line of the other contact as line2 (gpioinfo lists them), or line2 = none");
    } else if (error == EAFNOSUPPORT && is_bus) {
        inspect_add(findings, check, findings->absent, "bus %s: this kernel has no CAN sockets", cause);
        inspect_fix(findings, "modprobe can_raw, or use the simulator's bus: --can unix:PATH");
    } else {
        inspect_add(findings, check, INSPECT_FAIL, "%s %s: %s", what, cause, strerror(error));
        inspect_fix(findings, "correct %s", is_bus ? "[bus] interface or --can" : "[estop] line or --estop");
    }
}

inspect_opened_t inspect_open(iwl_hal_t *hal, const char *bus, const iwl_estop_config_t *line,
                              inspect_findings_t *findings) {
    const iwl_estop_config_t none = {.name = "none"};
    inspect_opened_t opened = {.bus = true, .estop = true};
    const char *cause = NULL;
    int error = iwl_hal_open(hal, bus, line, &cause);
    for (unsigned i = 0; i < 2U && error != 0; i++) {
        opened.bus = opened.bus && cause != bus;
        opened.estop = opened.estop && cause == bus;
        inspect_unopened(cause, cause == bus, error, findings);
        error = iwl_hal_open(hal, opened.bus ? bus : NO_BUS, opened.estop ? line : &none, &cause);
    }
    opened.hal = error == 0;
    return opened;
}
