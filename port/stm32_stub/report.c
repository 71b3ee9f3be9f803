// SPDX-License-Identifier: MIT
#include "report.h"

#include "bit_rate.h"
#include "commander.h"
#include "console.h"
#include "pins.h"

#include "iwheel_northbound/words.h"

// What is shown now, in one number; 0: nothing was shown yet.
static uint32_t shown;

static void pin(uint32_t number) {
    const char name[] = {' ', 'P', (char)('A' + number / 16U), '\0'};
    iw_console_text(name);
    iw_console_number(number % 16U);
}

void iw_report_no_crystal(void) {
    iw_console_text("no crystal of ");
    iw_console_number(IW_BOARD_CRYSTAL_HZ / 1000U);
    iw_console_text(" kHz yet: the bus is left alone until it runs\r\n");
}

static void tell_board(void) {
    iw_console_text("iwheel " IWHEEL_VERSION " on " IW_BOARD_NAME ": clock ");
    iw_console_number(IW_BOARD_CORE_HZ / 1000000U);
    iw_console_text((IW_BOARD_CRYSTAL_IS_CLOCK != 0) ? " MHz from a signal of " : " MHz from a crystal of ");
    iw_console_number(IW_BOARD_CRYSTAL_HZ / 1000U);
    iw_console_text(" kHz; CAN on");
    pin(IW_BOARD_CAN_RX);
    pin(IW_BOARD_CAN_TX);
    iw_console_text(" at ");
    iw_console_number(IW_BOARD_APB1_HZ / IW_BIT_PRESCALER / IW_BIT_QUANTA);
    iw_console_text(" bit/s, sampled at ");
    iw_console_number((1U + IW_BIT_BS1) * 100U / IW_BIT_QUANTA);
    iw_console_text((1000U * (1U + IW_BIT_BS1) / IW_BIT_QUANTA % 10U == 5U) ? ".5 %, BTR " : " %, BTR ");
    iw_console_hex(IW_BIT_BTR);
}

void iw_report_start(bool restarted) {
    tell_board();
    iw_console_text("; e-stop on");
    pin(IW_BOARD_ESTOP);
    iw_console_text(iw_pins_estop_high() ? ": pressed; " : ": released; ");
    iw_console_text(iw_commander_words());
    iw_console_text(restarted ? "; the run before was sending: zeros first\r\n" : "\r\n");
    shown = 0;
}

/// The words are those of the gateway's protocol (docs/northbound.md), so that one manual serves both.
static void tell_state(const iw_snapshot_t *seen, bool estop_pressed) {
    const iw_state_t state = seen->state;
    iw_console_text(iwn_state_name(state));
    if (state == IW_STATE_LATCHED || state == IW_STATE_STOPPING) {
        iw_console_text(" by ");
        iw_console_text(iwn_cause_name(seen->stop->cause));
    }
    iw_console_text("; bus ");
    iw_console_text(iwn_bus_state_name(seen->bus));
    iw_console_text(estop_pressed ? "; e-stop pressed" : "; e-stop released");
    if (state == IW_STATE_LATCHED) {
        iw_console_text("; to reset: mend the cause, release the e-stop, then press the button on");
        pin(IW_BOARD_BUTTON);
    }
    iw_console_text("\r\n");
}

iw_snapshot_t *iw_report_room(void) {
    static iw_snapshot_t seen;
    return &seen;
}

void iw_report_step(const iw_snapshot_t *seen, bool estop_pressed) {
    const uint32_t state = (uint32_t)seen->state;
    // The top bit tells "nothing happens" from "nothing was shown".
    const uint32_t now = 0x80000000U | (estop_pressed ? 0x10000U : 0U) | ((uint32_t)seen->stop->cause << 8) |
                         ((uint32_t)seen->bus << 4) | state;
    if (iw_console_asked()) {
        iw_report_start(false);
    }
    if (now != shown) {
        shown = now;
        tell_state(seen, estop_pressed);
    }
}

/// With the cure where the operator at the machine has one.
void iw_report_reset(iw_refusal_t refusal) {
    static const char *const words[] = {
        [IW_REFUSE_NONE] = "done",
        [IW_REFUSE_LATCHED] = "still latched",
        [IW_REFUSE_ESTOP_PRESSED] = "refused: the e-stop is pressed",
        [IW_REFUSE_BUS_DOWN] = "refused: the bus is down",
        [IW_REFUSE_WHEEL_LOST] = "refused: a wheel is not heard; give it power",
        [IW_REFUSE_NOT_AT_REST] = "refused: a wheel still turns",
        [IW_REFUSE_SECOND_MASTER] = "refused: somebody else sends setpoints",
        [IW_REFUSE_CAUSE_PRESENT] = "refused: its cause was there within the last second",
        [IW_REFUSE_STALE_COMMAND] = "refused: a command that moves is still being given",
    };
    const char *const found = ((size_t)refusal < sizeof words / sizeof words[0]) ? words[refusal] : NULL;
    iw_console_text("reset ");
    iw_console_text((found != NULL) ? found : "refused");
    iw_console_text("\r\n");
}
