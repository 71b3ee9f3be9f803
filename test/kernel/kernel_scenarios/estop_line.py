# SPDX-License-Identifier: MIT
"""Rows 11 to 14: the e-stop on a GPIO line."""

import os
import random
import subprocess
import time

import netdev
from catalogue import add, kernel_test
from gpio_sim import Edges, GpioChip
from kernel_rig import ESTOP_US, LEVEL_US, HighVcanRig, SlcanRig, TwoContactsRig, VcanRig, virtual
from scenario import Skip
from scenarios.estop import released_from_start

PRESSES, PRESSES_HIGH, PRESSES_REAL_TIME, PRESSES_FULL = 100, 25, 25, 1000
SERIES = 100  # presses of one gateway: its recording fits into a small machine
SLOW = {"limits": {"wheel_silent_ms": 200}}
PULSES_MS = (1, 2, 3, 5, 7, 10, 15, 20)


def one_press(t, rig, driver, other, chance):
    """Arms, drives, presses at a random moment of the ramp or the steady part, releases, resets."""
    stream = t.start_driving(driver, chance.randrange(-600, 600), chance.randrange(-600, 600), chance.uniform(0.05, 0.6))
    pressed_us = rig.press()
    time.sleep(chance.uniform(0.01, 0.05))
    status = other.request("status")
    latched = status["state"] == "latched" and status["cause"] == "estop_line"
    t.rule(latched, f"latched expected after a press, it is {status['state']}, {status['cause']}", at_us=pressed_us)
    stream.stop()
    t.expect(other.request("reset"), "estop_pressed")
    rig.release()
    time.sleep(chance.uniform(0, 0.05))
    t.rule(other.request("status")["state"] == "latched", "release alone must not unlatch", at_us=pressed_us)
    t.reset(other)
    return not t.failures


def series(t, count, chance):
    """Presses on a rig of their own. Its recording is judged, and deleted if it is correct."""
    rig, driver = t.running()
    other = rig.client("other")
    for _ in range(count):
        if not one_press(t, rig, driver, other, chance):
            break
    t.judge(rig)
    if not t.failures:
        rig.close()
        t.rigs.remove(rig)


def report_figures(t):
    """The figures of all series together."""
    t.figures.clear()
    t.figure(f"longest gap {t.measures['gap_ms']:.0f} ms")
    t.judge_estop("e-stop to zero", t.latencies, ESTOP_US)
    if not virtual():
        t.judge_estop("from the level", t.from_level, LEVEL_US)
        t.figure(f"worst {max((us for _, us in t.from_level), default=0) / 1000:.2f} ms")


def presses(t, count, seed):
    chance = random.Random(seed)
    for done in range(0, count, SERIES):
        series(t, min(SERIES, count - done), chance)
        if t.failures:
            return
    if t.late_machine > 0.1 * count:
        raise Skip(f"the machine was late during {t.late_machine} of {count} presses; needs a quieter one")
    report_figures(t)
    if t.late_machine:
        t.figure(f"{t.late_machine} presses do not count: the machine was late")
    t.check(t.met >= 0.9 * count, f"{t.met} of {count} presses met a running setpoint")


@kernel_test("presses in motion at random phase", "estop", 11)
def row11_presses_low(t):
    count = PRESSES if t.plan["group"] == "estop" else PRESSES_HIGH
    presses(t, PRESSES_FULL if t.plan["full"] else count, t.plan["seed"])


@kernel_test("presses in motion at random phase, contact normally closed", "estop", 11, HighVcanRig, pace=1)
def row11_presses_high(t):
    presses(t, PRESSES_HIGH, t.plan["seed"] + 1)


@kernel_test("presses in motion at random phase, through an adapter", "estop", 11, SlcanRig)
def row11_presses_adapter(t):
    presses(t, PRESSES_HIGH, t.plan["seed"] + 2)


@kernel_test("presses in motion at random phase, in real time", "realtime", 11)
def row11_presses_real_time(t):
    presses(t, PRESSES_REAL_TIME, t.plan["seed"] + 3)


def add_real_time(number):
    """One series of the thousand presses: each series is repeated on its own if the machine was late."""

    def run(t):
        presses(t, SERIES, t.plan["seed"] + 100 + number)

    title = f"presses in motion at random phase, in real time, series {number} of {PRESSES_FULL // SERIES}"
    add(f"row11_real_time_{number:02d}", title, run, groups="realtime-full", row=11, rig=VcanRig)


for series_number in range(1, PRESSES_FULL // SERIES + 1):
    add_real_time(series_number)


def pulses(t):
    chance = random.Random(t.plan["seed"])
    rig, client = t.running()
    for pulse_ms in PULSES_MS:
        stream = t.start_driving(client, 300, 300, chance.uniform(0.2, 0.3))
        rig.pulse(pulse_ms / 1000)
        stream.stop(after=0.05)
        t.stopped_by(client, "estop_line")
        t.reset(client)
    t.figure(f"{len(PULSES_MS)} pulses of {PULSES_MS[0]} to {PULSES_MS[-1]} ms")
    t.judge(rig)


@kernel_test("pulses of 1 to 20 ms latch", "estop", 12)
def row12_pulses_low(t):
    pulses(t)


@kernel_test("pulses of 1 to 20 ms latch, contact normally closed", "estop realtime-full", 12, HighVcanRig)
def row12_pulses_high(t):
    pulses(t)


@kernel_test("a pulse in the same instant as its end latches: the edge counts, not the level", "estop", 12)
def row12_glitch(t):
    rig, client, stream = t.driving(seconds=0.4, every=0.05)
    rig.pulse(0)
    stream.stop(after=0.05)
    t.stopped_by(client, "estop_line")
    t.reset(client)
    t.judge(rig)


def expect_at(t, rig, client, state, at):
    """The e-stop is in that state, by those contacts."""
    reached = rig.wait_status(client, lambda s: (s["estop"]["state"], s["estop"]["pressed_at"]) == (state, at), 2)
    t.check(reached, f"{state} at {at} expected, it is {client.request('status')['estop']}")


@kernel_test("two contacts on two lines: either stops, both must release, and both prove the button", "estop", 11, TwoContactsRig)
def row11_two_lines(t):
    rig, client = t.running()
    for second_too in (False, True):
        for first in (True, False):
            stream = t.start_driving(client, 300, 300, 0.4)
            (rig.press if first else lambda: rig.second(True))()
            time.sleep(0.05)
            expect_at(t, rig, client, "pressed", "line" if first else "line2")
            stream.stop()
            t.stopped_by(client, "estop_line")
            t.expect(client.request("reset"), "estop_pressed")
            if second_too:
                rig.second(True)
                rig.chip.pull(False)
                time.sleep(0.1)
                expect_at(t, rig, client, "pressed", "both")
            rig.release()
            rig.second(False)
            t.reset(client)
            tried = client.request("status")["estop"]["tried_wall_us"]
            t.check((tried is not None) == second_too, f"tried: {tried}, both were pressed: {second_too}")
    t.judge(rig)


@kernel_test("one of two contacts shorted: reported, and no reset until both were pressed, then released", "estop", 13, TwoContactsRig)
def row13_line_shorted(t):
    rig, client, stream = t.driving(seconds=0.4, every=0.05)
    rig.press()
    stream.stop(after=0.05)
    t.stopped_by(client, "estop_line")
    expect_at(t, rig, client, "disagrees", "line")
    t.check("estop_disagrees" in client.request("status")["present"], "the cause is present")
    rig.release()
    for _ in range(3):
        time.sleep(0.5)
        t.expect(client.request("reset"), "cause_present")
    rig.second(True)
    time.sleep(0.1)
    rig.second(False)
    time.sleep(0.5)
    t.expect(client.request("reset"), "cause_present")
    t.rule(client.request("status")["state"] == "latched", "one contact alone does not fix it")
    rig.chip.pull(False)
    rig.second(True)
    time.sleep(0.1)
    expect_at(t, rig, client, "disagrees", "both")
    rig.release()
    rig.second(False)
    expect_at(t, rig, client, "released", "neither")
    t.reset(client)
    t.drive_and_judge(rig, client)


@kernel_test("one line under two names as both contacts: no start, and the message names the keys", "estop", 29, TwoContactsRig)
def row29_line_twice(t):
    rig = t.rig()
    rig.configure(estop={"line2": f"{rig.chip.chip}:{rig.chip.OFFSET}"})
    done = subprocess.run(rig.gateway_command(), capture_output=True, text=True, timeout=10, check=False)
    t.check(done.returncode == 78, f"exit code {done.returncode}")
    t.check("line and line2 are the same line" in done.stderr, f"names the keys: {done.stderr}")


@kernel_test("a chattering contact on release: reset waits for a quiet line", "estop", 13)
def row13_chatter(t):
    rig, client = t.running()
    t.arm_and_drive(client, 200, 200, 0.5)
    rig.press()
    time.sleep(1.5)
    for _ in range(400):
        rig.release()
        time.sleep(0.002)
        rig.chip.pull(rig.active == "high")
        time.sleep(0.002)
        refusal = client.request("reset")
        t.check(not refusal["ok"], "reset must be refused while the contact chatters")
        if t.failures:
            break
    rig.release()
    t.reset(client)
    time.sleep(0.3)
    t.check(client.request("status")["state"] == "listening", "then it is accepted")
    t.judge(rig)


@kernel_test("pressed at start: latched; reset refused while pressed; release alone moves nothing", "estop realtime-full", 13, HighVcanRig)
def row13_pressed_at_start(t):
    rig = t.rig()
    rig.chip.pull(rig.active == "high")
    client = rig.connect_to_new(wheels=False)
    online = rig.wait_at_rest(client, 3)
    t.check(online and online["state"] == "latched", f"latched from the start: {online and online['state']}")
    t.stopped_by(client, "estop_line")
    released_from_start(t, rig, client, 1.5, 0.7)
    t.drive_and_judge(rig, client)


def lost_chip(t, rig, client, after_s=0.6):
    """Loses the line in motion, checks for a busy loop, finds the line again, resets, drives.

    Telemetry is slow, so that it does not wake the gateway by chance: the removal of the chip wakes no process.
    """
    rig.sim.ask("slow 40")
    stream = t.start_driving(client, 300, 300, after_s)
    rig.lose_chip()
    stream.stop(after=0.2)
    t.stopped_by(client, "estop_line")
    share = rig.gateway.cpu_share(2.0)
    t.check(share < 0.5, f"{100 * share:.0f} % CPU without the line", True)
    refusal = client.request("reset")
    t.check(not refusal["ok"], "no reset without a line")
    rig.find_chip()
    t.check(rig.wait_status(client, lambda s: s["estop"]["state"] == "released", 3), "found again")
    t.rule(client.request("status")["state"] == "latched", "its return alone does not unlatch")
    t.reset(client)
    t.arm_and_drive(client, 200, 200, 0.5)


@kernel_test("the GPIO chip disappears in motion, at every phase of the cycle, and returns", "estop", 14)
def row14_chip_vanishes(t):
    rig, client = t.running(SLOW)
    for after_s in (0.6, 0.603, 0.608, 0.612, 0.617):
        lost_chip(t, rig, client, after_s)
        t.stop_until_silent(rig, client)
    t.judge(rig)


@kernel_test("the GPIO chip disappears in motion, in real time", "realtime", 14)
def row14_chip_vanishes_real_time(t):
    rig, client = t.running(SLOW)
    lost_chip(t, rig, client)
    t.judge(rig)


@kernel_test("no GPIO chip at start: latched; it appears: reset", "estop", 14)
def row14_no_chip_at_start(t):
    rig = t.rig()
    rig.lose_chip()
    client = rig.connect_to_new(wheels=False)
    rig.wait_at_rest(client, 3)
    status = client.request("status")
    t.check(status["state"] == "latched", f"{status['state']}")
    t.check(status["estop"]["state"] == "unreadable", f"e-stop {status['estop']['state']}")
    t.check(rig.line in rig.gateway.text(), f"the log names the line: {rig.gateway.text()[-300:]}")
    t.expect(client.request("reset"), "estop_pressed")
    rig.find_chip()
    t.reset(client)
    t.drive_and_judge(rig, client)


@kernel_test("the line is busy at start: pressed; it is freed: reset", "estop", 14)
def row14_line_busy(t):
    rig = t.rig()
    holder = Edges(rig.chip.chip, rig.chip.OFFSET)
    client = rig.connect_to_new(wheels=False)
    rig.wait_at_rest(client, 3)
    status = client.request("status")
    t.check(status["state"] == "latched" and status["estop"]["state"] == "unreadable", f"{status['state']}, {status['estop']}")
    text = rig.gateway.text()
    t.check("busy" in text.lower(), f"the log reports that it is busy: {text[-300:]}")
    t.expect(client.request("reset"), "estop_pressed")
    t.check(rig.gateway.cpu_share(2.0) < 0.5, "no busy loop", True)
    lines = len(rig.gateway.text().splitlines()) - len(text.splitlines())
    t.check(lines <= 3, f"{lines} lines of log in 2 s of a busy line")
    holder.close()
    rig.release()
    t.reset(client)
    t.drive_and_judge(rig, client)


@kernel_test("the line by chip and offset, and a name that does not exist", "estop", 14)
def row14_line_names(t):
    rig = t.rig()
    rig.line = f"{rig.chip.chip}:{rig.chip.OFFSET}"
    client = rig.connect_to_new()
    t.check(client.request("status")["estop"]["state"] == "released", "read by chip and offset")
    t.arm_and_drive(client, 200, 200, 0.4)
    rig.press()
    time.sleep(0.1)
    t.stopped_by(client, "estop_line")
    t.judge(rig)


@kernel_test("a link to the line's chip, as on a Raspberry Pi 5: its name is one line; a second line with this name is refused", "estop", 14)
def row14_linked_chip(t):
    rig = t.rig()
    link = f"/dev/gpiochip9{rig.chip.chip.removeprefix('gpiochip')}"
    twin = None
    os.symlink(rig.chip.chip, link)
    try:
        client = rig.connect_to_new()
        t.check(client.request("status")["estop"]["state"] == "released", f"read next to the link: {rig.gateway.text()[-300:]}")
        t.arm_and_drive(client, 200, 200, 0.4)
        rig.press()
        time.sleep(0.1)
        t.stopped_by(client, "estop_line")
        rig.release()
        t.reset(client)
        t.judge(rig)
        client.close()
        rig.gateway.end()
        twin = GpioChip(f"twin{os.getpid()}", rig.line)
        client = rig.connect_to_new(wheels=False)
        t.check(client.request("status")["estop"]["state"] == "unreadable", "two chips have the name")
    finally:
        os.unlink(link)
        if twin is not None:
            rig.gateway.end()
            twin.remove()


@kernel_test("the button is untried until it was pressed and released; another name of its line makes it untried again", "estop", 13)
def row13_button_tried(t):
    rig = t.rig()

    def untried(client):
        status = client.request("status")
        warned = any("never seen to work" in warning for warning in status["warnings"])
        t.check(
            warned == (status["estop"]["tried_wall_us"] is None), f"the warning is present only while it is untried: {status['estop']}, {status['warnings']}"
        )
        return warned

    def started():
        client = rig.connect_to_new()
        rig.wait_status(client, lambda s: s["memory"]["state"] in ("new", "kept"), 3)
        time.sleep(0.2)
        return client

    def ended(client):
        client.close()
        rig.gateway.end()

    client = started()
    t.check(untried(client), "the button was not pressed yet")
    reply = client.request("arm", name="tester")
    t.check(reply["ok"] and any("never seen to work" in warning for warning in reply["warnings"]), f"arm warns: {reply}")
    t.stop_for(client, 3)
    rig.press()
    time.sleep(0.3)
    t.check(untried(client), "a press alone does not test it")
    rig.release()
    time.sleep(1.5)
    t.check(not untried(client), "pressed and released")
    t.reset(client)
    time.sleep(1.5)
    ended(client)
    client = started()
    t.check(not untried(client), "known after a restart")
    ended(client)
    rig.line = f"{rig.chip.chip}:{rig.chip.OFFSET}"
    client = started()
    t.check(untried(client), "its line has another configuration")
    t.drive_and_judge(rig, client)


@kernel_test("an adapter without rights over the interface drives and stops as well", "estop", 11, SlcanRig)
def row11_without_rights(t):
    rig, client = t.running(setup=netdev.without_net_admin)
    chance = random.Random(t.plan["seed"])
    for _ in range(5):
        if not one_press(t, rig, client, client, chance):
            break
    t.judge(rig)
