// SPDX-License-Identifier: MIT
#include "report.h"

#include "bit_rate.h"
#include "commander.h"
#include "console.h"
#include "fault.h"
#include "pins.h"

#include "iwheel_northbound/words.h"

// State that was printed last, as one number; 0: none was printed yet.
static uint32_t shown;

static void pin(uint32_t number) {
    const char name[] = {' ', 'P', (char)('A' + number / 16U), '\0'};
    brd_console_text(name);
    brd_console_number(number % 16U);
}

void brd_report_no_crystal(void) {
    brd_console_text("no crystal of ");
    brd_console_number(BRD_CRYSTAL_HZ / 1000U);
    brd_console_text(" kHz yet: the bus is left alone until it runs\r\n");
}

static void report_board(void) {
    brd_console_text("iwheel " IWHEEL_VERSION " on " BRD_NAME ": clock ");
    brd_console_number(BRD_CORE_HZ / 1000000U);
    brd_console_text((BRD_CRYSTAL_IS_CLOCK != 0) ? " MHz from a signal of " : " MHz from a crystal of ");
    brd_console_number(BRD_CRYSTAL_HZ / 1000U);
    brd_console_text(" kHz; CAN on");
    pin(BRD_CAN_RX);
    pin(BRD_CAN_TX);
    brd_console_text(" at ");
    brd_console_number(BRD_APB1_HZ / BRD_BIT_PRESCALER / BRD_BIT_QUANTA);
    brd_console_text(" bit/s, sampled at ");
    brd_console_number((1U + BRD_BIT_BS1) * 100U / BRD_BIT_QUANTA);
    brd_console_text((1000U * (1U + BRD_BIT_BS1) / BRD_BIT_QUANTA % 10U == 5U) ? ".5 %, " BRD_BIT_REGISTER " "
                                                                               : " %, " BRD_BIT_REGISTER " ");
    brd_console_hex(BRD_BIT_BTR);
}

void brd_report_start(bool restarted) {
    report_board();
    brd_console_text("; e-stop on");
    pin(BRD_ESTOP);
    brd_console_text(brd_pins_estop_high() ? ": pressed; " : ": released; ");
    brd_console_text(brd_commander_name());
    const brd_fault_t fault = brd_fault_take();
    if (fault.cause != 0U) {
        brd_console_text("; the previous run ended with fault ");
        brd_console_hex(fault.cause);
        brd_console_text(" at ");
        brd_console_hex(fault.pc);
    }
    brd_console_text(restarted ? "; the run before was sending: zeros first\r\n" : "\r\n");
    shown = 0;
}

/// Uses the words of the gateway's protocol (docs/user/northbound.md), so that one manual covers both.
static void report_state(const iw_snapshot_t *seen, bool estop_pressed) {
    const iw_state_t state = seen->state;
    brd_console_text(iwn_state_name(state));
    if (state == IW_STATE_LATCHED || state == IW_STATE_STOPPING) {
        brd_console_text(" by ");
        brd_console_text(iwn_cause_name(seen->stop->cause));
    }
    brd_console_text("; bus ");
    brd_console_text(iwn_bus_state_name(seen->bus));
    brd_console_text(estop_pressed ? "; e-stop pressed" : "; e-stop released");
    if (state == IW_STATE_LATCHED) {
        brd_console_text("; to reset: fix the cause, release the e-stop, then press the button on");
        pin(BRD_BUTTON);
    }
    brd_console_text("\r\n");
}

iw_snapshot_t *brd_report_room(void) {
    static iw_snapshot_t seen;
    return &seen;
}

void brd_report_step(const iw_snapshot_t *seen, bool estop_pressed) {
    const uint32_t state = (uint32_t)seen->state;
    // The top bit distinguishes the state 0 from "nothing was printed yet".
    const uint32_t now = 0x80000000U | (estop_pressed ? 0x10000U : 0U) | ((uint32_t)seen->stop->cause << 8) |
                         ((uint32_t)seen->bus << 4) | state;
    if (brd_console_asked()) {
        brd_report_start(false);
    }
    if (now != shown) {
        shown = now;
        report_state(seen, estop_pressed);
    }
}

/// The text contains the fix if the operator at the machine can do one.
void brd_report_reset(iw_refusal_t refusal) {
    static const char *const words[] = {
        [IW_REFUSE_NONE] = "done",
        [IW_REFUSE_LATCHED] = "still latched",
        [IW_REFUSE_ESTOP_PRESSED] = "refused: the e-stop is pressed",
        [IW_REFUSE_BUS_DOWN] = "refused: the bus is down",
        [IW_REFUSE_WHEEL_LOST] = "refused: a wheel is offline; switch it on",
        [IW_REFUSE_NOT_AT_REST] = "refused: a wheel still turns",
        [IW_REFUSE_SECOND_MASTER] = "refused: another node sends setpoints",
        [IW_REFUSE_CAUSE_PRESENT] = "refused: its cause was present less than a second ago",
        [IW_REFUSE_STALE_COMMAND] = "refused: a client still sends nonzero commands",
    };
    const char *const found = ((size_t)refusal < sizeof words / sizeof words[0]) ? words[refusal] : NULL;
    brd_console_text("reset ");
    brd_console_text((found != NULL) ? found : "refused");
    brd_console_text("\r\n");
}
