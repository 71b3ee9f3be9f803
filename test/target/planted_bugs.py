# SPDX-License-Identifier: MIT
"""Bugs that somebody could write into the port: file, text, what it becomes, and who must notice.

The tests of the driver against the model notice those of DRIVER, a scenario on the emulated STM32F103 those of IMAGE. All stand in
docs/planted-bugs.md as well: `section` is what is written there.
"""

HEADING = "## The STM32 port"
HEAD = f"""{HEADING}

Written by `test/target/planted --update`; `./check target` proves that it lists them all. Each bug is planted alone in a copy of the port, and
who stands beside it must notice: a test of the driver against a model of the controller, or a scenario of the emulated STM32F103 with
one of its images (these with `./check --full`).

| bug | file | noticed by |
|---|---|---|
"""

DRIVER = {
    "an echo for a frame that was not sent": (
        "bxcan.c", "i < outgoing->owed && (flags & IW_TSR_TXOK(mailbox)) != 0U;", "i < outgoing->owed;", "transmit"),
    "a frame that left while it was being replaced is forgotten": (
        "bxcan.c", "if ((iw_register_read(tsr) & IW_TSR_TXOK(mailbox)) == 0U) {", "{", "transmit"),
    "the end of an abort is not awaited": (
        "bxcan.c", "if (!poll_tsr(self, IW_TSR_RQCP(mailbox) | IW_TSR_TME(mailbox))) {", "if (false) {", "transmit"),
    "the old frame stays beside the new one": ("bxcan.c", "outgoing->frame[0].id == id)", "outgoing->frame[0].id == id + 1U)", "transmit"),
    "a wait without a bound": ("bxcan.c", "poll < self->config.poll_limit;", "true;", "transmit"),
    "a purge that claims success": ("bxcan.c", "if (!poll_tsr(self, EMPTY)) {", "if (false) {", "transmit"),
    "a purge that omits mailbox 2": ("bxcan.c", "(IW_TSR_ABRQ(0) | IW_TSR_ABRQ(1) | IW_TSR_ABRQ(2))", "(IW_TSR_ABRQ(0) | IW_TSR_ABRQ(1))", "transmit"),
    "a purge that gives up when the abort does not end": ("bxcan.c", "    start_anew(self);\n    return 1;", "    return 0;", "transmit"),
    "the controller is reset and nobody is told": ("bxcan.c", "    self->phase = IW_BXCAN_STARTING;\n    write_mcr", "    write_mcr", "transmit"),
    "an abort that reads TSR and writes it back": (
        "bxcan.c", "iw_register_write(tsr, IW_TSR_ABRQ(mailbox));", "iw_register_write(tsr, iw_register_read(tsr) | IW_TSR_ABRQ(mailbox));",
        "transmit"),
    "echoes from before a purge": ("bxcan.c", "    self->epoch++;\n", "", "transmit"),
    "the echo of a replaced frame bears other bytes": ("bxcan.c", "put(self, &outgoing->frame[i])", "put(self, &outgoing->frame[0])", "transmit"),
    "mailboxes in the order of the requests (TXFP)": ("bxcan.c", "IW_MCR_DBF | request", "IW_MCR_DBF | 0x04U | request", "transmit"),
    "no second attempt (NART)": ("bxcan.c", "IW_MCR_DBF | request", "IW_MCR_DBF | 0x10U | request", "transmit"),
    "bus-off left by the controller alone (ABOM)": ("bxcan.c", "IW_MCR_DBF | request", "IW_MCR_DBF | 0x40U | request", "modes"),
    "sending in bus-off": ("bxcan.c", "frame->dlc > IW_CAN_DATA_MAX || is_bus_off(self))", "frame->dlc > IW_CAN_DATA_MAX)", "modes"),
    "what waits survives bus-off": ("bxcan.c", "    (void)take_back(self);\n    write_mcr", "    write_mcr", "modes"),
    "not silent": ("bxcan.c", "(self->config.silent ? IW_BTR_SILM : 0U)", "0U", "modes"),
    "an error interrupt that never ends": (
        "bxcan.c", "iw_register_write(&self->config.registers->MSR, IW_MSR_ERRI);", "(void)self;", "modes"),
    "configured outside initialisation mode": ("bxcan.c", "        if (in_init) {\n", "        if (true) {\n", "modes"),
    "a release under way shows the old frame again": ("bxcan.c", "(status & IW_RF0R_RFOM0) != 0U || ", "", "receive"),
    "one overrun counted for ever": ("bxcan.c", "iw_register_write(&registers->RF0R, IW_RF0R_FOVR0);", "", "receive"),
    "losses that are not told": ("bxcan.c", "    if (tell_loss(self, out_frame)) {", "    if (false && tell_loss(self, out_frame)) {", "receive"),
    "29-bit frames taken for ours": ("bxcan.c", "| IW_CAN_EXTENDED)", ")", "receive"),
    "15 bytes copied out of 8": ("bxcan.c", "(uint8_t)((dlc < IW_CAN_DATA_MAX) ? dlc : IW_CAN_DATA_MAX)", "(uint8_t)dlc", "receive"),
    "a mask too wide": ("bxcan_filters.c", "{IW_ID_LEFT_SPEED, 0x21U}", "{IW_ID_LEFT_SPEED, 0x23U}", "receive"),
    "remote frames filtered out": ("bxcan_filters.c", "<< 5) | 0x08U", "<< 5) | 0x18U", "receive"),
    "filters changed while in force": ("bxcan_filters.c", "    set_bits(&device->FMR, IW_FMR_FINIT);", "    //", "modes"),
    "a ring that overwrites": ("frame_ring.c", "head - tail >= IW_FRAME_RING_LENGTH", "head - tail > IW_FRAME_RING_LENGTH", "receive"),
}

IMAGE = {
    "the bus at half its rate": ("main.c", "IW_BIT_BTR,", "IW_BIT_BTR + 1U,", "zero", "nominal"),
    "no wait states of the flash": ("clock_f1.c", "PRFTBE | IW_BOARD_FLASH_WAIT_STATES", "PRFTBE", "zero", "nominal"),
    "time goes back at a tick": ("cortex_m.c", "(SCB_ICSR & PENDSTSET) != 0U || ", "", "zero", "time_never_goes_back"),
    "edges of the e-stop are not latched": (
        "estop.c", "store_explicit(&had_edge, true,", "store_explicit(&had_edge, false,", "zero", "estop_pulse"),
    "no pull-up at the e-stop's pin": ("pins_f1.c", "    pull_up(IW_BOARD_ESTOP);\n", "", "zero", "estop"),
    "the crystal is waited for without a bound": ("clock.c", "poll < POLLS_MAX;", "true;", "zero", "no_crystal"),
    "the crystal's failure goes unnoticed": ("clock.c", "RCC_CR |= CSSON;", ";", "demo", "crystal_dies"),
    "an interrupt feeds the watchdog": (
        "main.c", "    iw_bxcan_on_receive(&bus);\n", "    iw_bxcan_on_receive(&bus);\n    iw_watchdog_feed();\n", "demo", "loop_stuck"),
    "no watchdog": ("main.c", "    iw_watchdog_start();\n", "", "demo", "hang"),
    "nobody remembers that setpoints were being sent": ("main.c", "start_gateway(&gateway, &config, restarted)", "start_gateway(&gateway, &config, false)",
                                                        "demo", "hang"),
    "a button that is down counts as a press": (
        "commander.c", "const bool press = level && self->released;", "const bool press = level;", "demo", "demo_button_held_through_reset"),
    "the profile goes on after a stop": ("commander_demo.c", "        self->running = false;\n        if (press)", "        if (press)",
                                         "demo", "bus_off"),
    "it acknowledges although it only listens": ("main.c", ".silent = !iw_commander_sends()", ".silent = false", "listen", "listening"),
    "echoes do not wake the loop, nor frames": ("main.c", "    iw_wake();\n", "", "zero", "full_bus"),
    "the press edge of the e-stop is not enabled": ("estop.c", "    EXTI->RTSR |= LINE;\n", "", "zero", "estop_wakes"),
    "the e-stop's interrupt is another port's": ("pins_f1.c", " | (IW_BOARD_ESTOP / 16U)", "", "zero", "estop_pulse"),
    "milliseconds in 32 bits": ("cortex_m.c", "static volatile uint64_t ticks_ms;", "static volatile uint32_t ticks_ms;", "zero",
                                "time_passes_32_bits_of_milliseconds"),
    "microseconds in 32 bits": ("cortex_m.c", "return now_ms * IW_US_PER_MS +", "return (uint32_t)(now_ms * IW_US_PER_MS) +", "zero",
                                "time_passes_32_bits_of_microseconds"),
    "the marker is cleared before a zero was sent": ("marker.c", "    if (!was_sending) {\n", "    {\n", "demo", "reset_again"),
    "the marker is cleared by a hold that nobody acknowledged": ("marker.c", "} else if (zeros_proven) {", "} else {", "demo",
                                                                 "reset_after_unproven_hold"),
    "the marker is never cleared": ("marker.c", "} else if (zeros_proven) {", "} else if (false) {", "demo", "reset_after_the_hold"),
    "the crystal starts anew at each attempt": ("clock.c", "    RCC_CR &= ~PLLON;\n", "    RCC_CR &= ~(PLLON | HSEON);\n", "zero", "slow_crystal"),
    "the bus is on other pins than told": ("pins_f1.c", "(2U << 13)", "(3U << 13)", "zero", "nominal"),
    "the controller's reset has the wrong bit": ("main.c", "(1U << 25)", "(1U << 26)", "demo", "abort_without_end"),
    "a fault that goes on": ("startup.c", "b iw_system_reset", "b .", "demo", "stack_overflow"),
    "a command of an earlier start is obeyed": ("answers.c", "if (boot != self->place.boot) {", "if (false) {", "gateway", "stale_in_every_way"),
    "a command that was held up is obeyed": ("answers.c", "self->now_us - quote->t_us > self->lease_us", "false", "gateway", "stale_in_every_way"),
    "a command is obeyed twice": ("answers.c", "if (client->has_seq && quote->seq <= client->seq) {", "if (false) {", "gateway", "stale_in_every_way"),
    "a command without a quote is obeyed": ("host.c", "quoted ? &quote : NULL", "&(iwn_quote_t){.boot = {0}}", "gateway", "stale_in_every_way"),
    "a closed channel keeps its lease": ("host.c", "        iw_gateway_disconnect(self->place.gateway, self->now_us, client->id);\n", "", "gateway", "close_ends"),
    "the channels outlive a relay that fell silent": ("host.c", "if (now_us - self->heard_us >= ", "if (false && now_us - self->heard_us >= ", "gateway",
                                                      "silent_relay"),
    "another relay inherits the clients": ("host.c", "        end_all(self); // Another", "        // Another", "gateway", "relay_killed_and_anew"),
    "who may only watch may drive": ("answers.c", "client->watches_only && !may_watch", "false && !may_watch", "gateway", "nobody_feeds_another"),
    "a line is written over while it is being sent": ("serial.c", "    return lent != NULL;\n", "    return false;\n", "gateway", "crowd"),
    "two power-ons have one name": ("boot.c", "((uint64_t)power_ons << 32)", "0U", "gateway", "power_cut_while_writing"),
    "a configuration is written while the wheels turn": ("answers.c", "    if (!iw_host_is_silent(self)) {\n", "    if (false) {\n", "gateway", "config_in_flash"),
    "what is learnt is written while something can move": ("host.c", "if (!iw_host_is_silent(self) || self->learn_us", "if (self->learn_us", "gateway", "learnt_in_flash"),
    "what is learnt is not put in force": ("host.c", "        iw_learnt_restore(&learnt, &self->place.settings, self->place.gateway, self->zero);\n", "", "gateway", "learnt_in_flash"),
    "half a record counts": ("store.c", "read(page, slot, CRC_AT) == crc_of(page, slot)", "true", "gateway", "power_cut_while_writing"),
    "a console that waits": ("console.c", "    if (put != taken && (USART2->SR & TXE) != 0U) {\n",
                             "    while (put != taken) {\n        while ((USART2->SR & TXE) == 0U) {\n        }\n", "zero", "console"),
}


def section():
    """Of docs/planted-bugs.md, from its heading to the end."""
    driver = [f"| {name} | `port/stm32_stub/{file}` | `test_bxcan_{test}` |" for name, (file, _, _, test) in DRIVER.items()]
    image = [f"| {name} | `port/stm32_stub/{file}` | scenario `{scenario}`, image `{image}` |"
             for name, (file, _, _, image, scenario) in IMAGE.items()]
    return HEAD + "\n".join(driver + image) + "\n"


def replace_section(page):
    """The page with this section as it should be."""
    return page.split(HEADING)[0].rstrip("\n") + "\n\n" + section()
