# SPDX-License-Identifier: MIT
"""Rows 15 and 17 on vcan: interfaces that go down, disappear, refuse frames, echo late or never."""

import os
import re
import subprocess
import time

import netdev
from catalogue import kernel_test
from harness import now_us
from judge_log import LEFT, RIGHT, Event
from scenario import Skip
from scenarios.bus_states import drive_again, judge_repaired, only_zeros

UNITS = os.path.join(os.path.dirname(os.path.abspath(__file__)), *[os.pardir] * 3, "share", "systemd")
BLINKS_MS = (0, 2.5, 5.3, 9.9, 13.1, 16.7, 19.9)  # later than the last command; a period is 20 ms
REOPENED_MS = 260  # the gateway searches every 200 ms for an interface that was down
STALE_US = 20_000  # frames later than this after the return of a bus were not in transit any more


def lose_interface(t, rig, client, stream, lose, causes=("bus_down",)):
    """The interface disappears in motion; the caller checks the rest of the row of the catalogue."""
    lost_us = rig.cut_by(lose, 60)
    stream.stop(after=0.3)
    why = client.request("why")
    t.check(why["cause"] in causes, f"cause {why['cause']}, one of {causes} expected: {why.get('sentence')}")
    t.check(client.request("status")["state"] == "latched", "latched")
    t.measure("stop_ms", (why["at_us"] - lost_us) / 1000 if why["at_us"] else 0)
    refusal = client.request("reset")
    t.check(not refusal["ok"], "no reset while the bus is down")
    t.expect(client.arm(), "latched")


@kernel_test("interface down in motion, and up again: stop, no backlog", "bus realtime", 15)
def row15_down_and_up(t):
    rig, client, stream = t.driving()
    lose_interface(t, rig, client, stream, lambda: netdev.down(rig.interface))
    time.sleep(1.0)
    judge_repaired(t, rig, client, lambda: netdev.up(rig.interface))


@kernel_test("interface down and up within a moment, at every phase of the cycle: it stops anyway", "bus", 15)
def row15_blink(t):
    rig, client, stream = t.driving()

    def blink():
        netdev.down(rig.interface)
        netdev.up(rig.interface)

    for phase_ms in BLINKS_MS:
        time.sleep(phase_ms / 1000)
        back_us = rig.cut_by(blink, REOPENED_MS)
        rig.timeline.append(Event(back_us, "alive", back_us + REOPENED_MS * 1000))
        stream.stop(after=0.4)
        t.first_after(rig, back_us, lambda speed: speed == 0, "zero after the blink", REOPENED_MS)
        t.stopped_by(client, "bus_down")
        moving = [(at - back_us, value) for at, _, value in rig.bus.setpoints(back_us + 1) if value]
        t.rule(not moving, f"{phase_ms} ms: motion after the interface came back: {moving[:4]}")
        drive_again(t, rig, client)
        if t.failures or phase_ms == BLINKS_MS[-1]:
            break
        stream = t.start_driving(client, 300, 300, 0.7, 0.02)
    t.judge(rig)


@kernel_test("interface deleted in motion and made again: reopened by name, zero first", "bus realtime-full", 15)
def row15_deleted_and_made_again(t):
    rig, client, stream = t.driving()
    lose_interface(t, rig, client, stream, lambda: netdev.delete(rig.interface))
    t.check(rig.gateway.cpu_share(2.0) < 0.5, "no busy loop without an interface", True)
    netdev.add_vcan(rig.interface)
    back_us = now_us()
    rig.relisten()
    rig.sim.end()
    rig.sim = type(rig.sim)(rig)
    rig.note("alive")
    drive_again(t, rig, client)
    only_zeros(t, rig, back_us)
    t.judge(rig)


@kernel_test("no interface at start: it waits, and finds it when it appears", "bus", 15)
def row15_absent_at_start(t):
    rig = t.rig()
    rig.sim.end()
    netdev.delete(rig.interface)
    client = rig.connect_to_new(wheels=False)
    status = client.request("status")
    t.check(status["bus"]["state"] == "down", f"bus {status['bus']}")
    t.expect(client.arm(), "bus_down")
    text = rig.gateway.text()
    t.check(rig.interface in text, f"the log names the interface: {text[-300:]}")
    time.sleep(2.0)
    lines = len(rig.gateway.text().splitlines()) - len(text.splitlines())
    t.check(lines <= 3, f"{lines} lines of log in 2 s without an interface")
    netdev.add_vcan(rig.interface)
    rig.relisten()
    rig.sim = type(rig.sim)(rig)
    rig.wait_at_rest(client, 5)
    t.drive_and_judge(rig, client)


@kernel_test("down while listening: an event, nothing sent, arm refused", "bus", 15)
def row15_down_while_listening(t):
    rig, client = t.running()
    client.request("watch", topics=["bus", "stop"])
    netdev.down(rig.interface)
    time.sleep(0.3)
    t.expect(client.arm(), "bus_down")
    t.check(client.request("status")["state"] == "listening", "not latched")
    states = [event["state"] for event in client.collect(0.1) if event["event"] == "bus"]
    t.check("down" in states, f"the event comes: {states}")
    netdev.up(rig.interface)
    online = rig.wait_at_rest(client, active=True)
    t.check(online, "back without reset")
    t.rule(not rig.bus.setpoints(), "nothing was sent")
    time.sleep(1.1)
    t.drive_and_judge(rig, client)


@kernel_test("ENOBUFS for 300 ms in motion: stop, no old frame afterwards", "bus realtime", 17)
def row17_no_buffers(t):
    rig, client, stream = t.driving()
    rig.cut_by(lambda: netdev.discipline(rig.interface, "pfifo", "limit", "0"), 120)
    time.sleep(0.3)
    netdev.discipline(rig.interface)
    back_us = rig.note("alive")
    stream.stop(after=0.3)
    why = client.request("why")
    t.check(why["cause"] in ("send_stalled", "wheel_lost"), f"cause {why['cause']}: {why.get('sentence')}")
    t.check(client.request("status")["state"] == "latched", "latched")
    only_zeros(t, rig, back_us)
    drive_again(t, rig, client)
    t.figure(f"stopped by {why['cause']}")
    t.judge(rig)


@kernel_test("ENOBUFS for 30 ms in motion: no old frame; the gateway continues, or stops from zero", "bus", 17)
def row17_no_buffers_short(t):
    rig, client, stream = t.driving({"limits": {"wheel_silent_ms": 200}})
    begin_us = now_us()
    netdev.discipline(rig.interface, "pfifo", "limit", "0")
    time.sleep(0.03)
    netdev.discipline(rig.interface)
    stream.stop(after=0.4)
    after = [(at, speed) for at, _, speed in rig.bus.setpoints(begin_us + 1)]
    t.check(after and not any(speed for _, speed in after[:2]), f"the first pair afterwards is zero: {after[:4]}")
    gap_ms = (after[0][0] - begin_us) / 1000 if after else 0
    t.check(gap_ms < 100, f"{gap_ms:.0f} ms without a setpoint")
    slope = [(speed, (at - after[0][0]) / 1e6 * 800 + 10) for at, speed in after]
    t.check(all(0 <= speed <= limit for speed, limit in slope), f"from zero by the configured slope: {slope[:8]}")
    t.figure(f"{client.request('status')['state']}, {gap_ms:.0f} ms without a setpoint")


# With vcan.echo=1 the echo comes through the queueing discipline: late or never.


def needs_echo(rig):
    if not netdev.flags(rig.interface) & netdev.IFF_ECHO:
        raise Skip("needs a boot with vcan.echo=1")


@kernel_test("nominal drive: the gateway reports the echo as proven", "echo", 17)
def row17_echo_proven(t):
    rig, client = t.running()
    needs_echo(rig)
    t.check(client.request("status")["bus"]["echo"] == "proven", "status: echo proven")
    t.arm_and_drive(client, 300, 300, 1.0)
    t.stop_until_silent(rig, client)
    t.judge(rig)


@kernel_test("without IFF_ECHO: the gateway reports the echo as unproven", "bus", 17)
def row17_echo_unproven(t):
    rig, client = t.running()
    t.check(client.request("status")["bus"]["echo"] == "unproven", "status: echo unproven")
    t.arm_and_drive(client, 300, 300, 0.5)
    t.judge(rig)


LATE = {"limits": {"wheel_silent_ms": 200}}  # netem delays the wheels' frames on the same interface too


@kernel_test("echo 30 ms late: within the limit, the gateway continues", "echo", 17)
def row17_echo_late_enough(t):
    rig, client = t.running(LATE)
    needs_echo(rig)
    netdev.discipline(rig.interface, "netem", "delay", "30ms")
    time.sleep(0.5)
    t.arm_and_drive(client, 300, 300, 1.0)
    t.check(client.request("status")["state"] == "armed", "still armed")
    t.stop_for(client, 0.6)
    t.judge(rig)


@kernel_test("echo 200 ms late at arm: refused, nothing but zeros", "echo", 17)
def row17_echo_too_late_at_arm(t):
    rig, client = t.running(LATE)
    needs_echo(rig)
    netdev.discipline(rig.interface, "netem", "delay", "200ms")
    time.sleep(0.6)
    reply = client.arm()
    time.sleep(0.5)
    state = client.request("status")["state"]
    t.check(not reply["ok"] or state == "latched", f"arm without an echo in time: {reply}, {state}")
    t.check(client.request("why")["cause"] == "send_stalled" or reply.get("error") == "send_stalled", "and prints the reason")
    t.rule(not any(speed for _, _, speed in rig.bus.setpoints()), "nothing but zeros")
    netdev.discipline(rig.interface)
    back_to_driving_if_latched(t, rig, client)


def back_to_driving_if_latched(t, rig, client):
    time.sleep(1.2)
    online = rig.wait_at_rest(client, 5)
    t.check(online, "the wheels are online")
    t.reset(client)
    t.arm_and_drive(client, 200, 200, 0.5)


def echo_fault(t, *netem):
    rig, client, stream = t.driving(LATE)
    needs_echo(rig)
    fault_us = rig.cut_by(lambda: netdev.discipline(rig.interface, "netem", *netem), 120)
    time.sleep(0.12)
    state = client.request("status")
    latched = t.check(state["state"] == "latched" and state["cause"] == "send_stalled", f"{state['state']}, {state['cause']}")
    t.measure("stop_ms", (client.request("why")["at_us"] - fault_us) / 1000 if latched else 0)
    stream.stop(after=0.5)
    netdev.discipline(rig.interface)
    back_us = rig.note("alive")
    time.sleep(0.2)
    only_zeros(t, rig, back_us + STALE_US)
    back_to_driving_if_latched(t, rig, client)
    t.stop_for(client, 0.3)
    t.judge(rig)


@kernel_test("echo 150 ms late in motion: stop within echo_ms, latched", "echo", 17)
def row17_echo_late(t):
    echo_fault(t, "delay", "150ms")


@kernel_test("no echo in motion: stop within echo_ms, latched", "echo", 17)
def row17_echo_missing(t):
    echo_fault(t, "loss", "100%")


def restart_as_the_unit_does(t, interface):
    """What systemd would do for iwheel-can-restart@.path: once the file has been written, the commands of the service."""
    with open(os.path.join(UNITS, "iwheel-can-restart@.path"), encoding="utf-8") as unit:
        watched = re.search(r"(?m)^PathChanged=(.*)$", unit.read())[1].replace("%i", interface)
    if not t.check(os.path.exists(watched), f"the gateway asks with {watched}"):
        return
    with open(os.path.join(UNITS, "iwheel-can-restart@.service"), encoding="utf-8") as unit:
        for command in re.findall(r"(?m)^ExecStart=(.*)$", unit.read()):
            netdev.command(*command.replace("%i", interface).split())


def reported_by_the_tool(t, rig):
    """The texts of `iwheelctl why` and `doctor` about it."""

    def ask(*words):
        return " ".join(
            subprocess.run(
                [rig.program("iwheelctl"), "--socket", rig.path("gateway.sock"), *words], text=True, stdin=subprocess.DEVNULL, capture_output=True, check=False
            ).stdout.split()
        )

    return {"why": ask("why"), "doctor": ask("doctor", "--no-press", "--listen", "300ms"), "status": ask("status")}


def restart_as_doctor_says(t, rig):
    """The commands in its fix."""
    commands = re.search(r"ip link set \S+ down; ip link set \S+ up", reported_by_the_tool(t, rig)["doctor"])
    if t.check(commands is not None, "doctor names the commands"):
        for command in commands[0].split("; "):
            netdev.command(*command.split())


def lost_echo(t, repair):
    """An echo gets lost while driving, and the gateway may not restart the link: reported, and fixed without a restart of the gateway."""
    rig = t.rig(LATE)
    needs_echo(rig)
    os.makedirs("/run/iwheel", exist_ok=True)
    rig.start_gateway(setup=netdev.without_net_admin)
    client, observer = rig.client(), rig.client("observer")
    observer.request("watch", topics=["stop"])
    stream = t.start_driving(client, 200, 200, 1.0, 0.02)
    rig.cut_by(lambda: netdev.discipline(rig.interface, "netem", "loss", "100%"), 120)
    stream.stop(after=0.3)
    time.sleep(0.3)
    netdev.discipline(rig.interface)
    rig.note("alive")
    time.sleep(12)
    t.expect(client.request("reset"), "send_stalled")
    refused = client.request("reset")["message"]
    said = " ".join(client.request("status")["warnings"])
    for sentence in (refused, said):
        t.check(f"ip link set {rig.interface} down; ip link set {rig.interface} up" in sentence, f"the fix is named: {sentence}")
    for what, text in {"a warning": said, **reported_by_the_tool(t, rig)}.items():
        t.check(f"ip link set {rig.interface} down; ip link set {rig.interface} up" in text, f"{what} names the fix: {text}")
        t.check(f"systemctl enable --now iwheel-can-restart@{rig.interface}.path" in text, f"{what} names the unit: {text}")
    reported = [e["present"] for e in observer.collect(0.1) if e["event"] == "fault" and e["cause"] == "setpoint_left"]
    t.check(reported == [True], f"the event comes: {reported}")
    silent_us = now_us()
    repair(rig)
    back_to_driving_if_latched(t, rig, client)
    reported = [e["present"] for e in observer.collect(0.1) if e["event"] == "fault" and e["cause"] == "setpoint_left"]
    t.check(reported == [True, False], f"and ends: {reported}")
    t.check("still in the controller" not in " ".join(client.request("status")["warnings"]), "no warning remains")
    armed = [event.t_us for event in rig.timeline if event.kind == "arm" and event.ok and event.t_us > silent_us]
    t.rule(not [at for at, _, _ in rig.bus.setpoints(silent_us) if at < min(armed)], "nothing is sent before it is armed again")
    t.stop_for(client, 0.3)
    t.judge(rig)


@kernel_test("a lost echo, the gateway may not restart the link: it reports this; setting the link down and up fixes it", "echo", 17)
def row17_echo_lost_no_rights(t):
    lost_echo(t, lambda rig: restart_as_doctor_says(t, rig))


@kernel_test("a lost echo, the gateway may not restart the link: it asks the unit that may, and the unit fixes it", "echo", 17)
def row17_echo_lost_unit_restarts(t):
    lost_echo(t, lambda rig: restart_as_the_unit_does(t, rig.interface))


def power_cut(t, setup):
    """No node acknowledges for 10 s at full command. The frames are held back; a controller would retry them."""
    rig = t.rig({"drive": {"accel_mm_s2": 2000}})
    needs_echo(rig)
    netdev.discipline(rig.interface, "plug")
    netdev.command("tc", "qdisc", "change", "dev", rig.interface, "root", "plug", "release_indefinite")
    client = rig.connect_to_new(setup=setup)
    stream = t.start_driving(client, 800, 800, 1.0, 0.02)
    fault_us = rig.cut_by(lambda: (netdev.command("tc", "qdisc", "change", "dev", rig.interface, "root", "plug", "block"), rig.sim.ask("power off")), 120)
    stream.stop(after=0.3)
    why = client.request("why")
    t.check(client.request("status")["state"] == "latched", "latched")
    t.measure("stop_ms", (why["at_us"] - fault_us) / 1000 if why["at_us"] else 0)
    t.check(not client.request("reset")["ok"], "reset is refused until the wheels are online")
    time.sleep(10)
    held_us = now_us()
    if "plug" in netdev.command("tc", "qdisc", "show", "dev", rig.interface):
        netdev.command("tc", "qdisc", "change", "dev", rig.interface, "root", "plug", "release_indefinite")
    time.sleep(0.01)
    rig.sim.ask("power on")
    rig.timeline.append(Event(held_us, "alive", held_us))
    time.sleep(1.0)
    late = [(at - held_us, side, speed) for at, side, speed in rig.bus.setpoints(held_us)]
    moving = [entry for entry in late if entry[2]]
    t.measure("stale_frames", len(moving))
    t.figure(f"{len(moving)} old and {len(late) - len(moving)} zero frames came out")
    return rig, client, late, moving


@kernel_test("wheel power off for 10 s at full command, the gateway may restart the link: no old frame", "echo", 18)
def row18_power_cut_purged(t):
    rig, client, late, moving = power_cut(t, None)
    t.rule(not moving, f"no old frame after a purge: {late[:6]}")
    back_to_driving_if_latched(t, rig, client)
    t.judge(rig)


@kernel_test("wheel power off for 10 s at full command, the gateway may not restart the link: one old frame, followed by its zero", "echo", 18)
def row18_power_cut_no_rights(t):
    rig, client, late, _moving = power_cut(t, netdev.without_net_admin)
    for side in (LEFT, RIGHT):
        here = [(at, speed) for at, can_id, speed in late if can_id == side]
        old = [number for number, (_, speed) in enumerate(here) if speed]
        t.check(len(old) <= 1, f"at most one old frame of {side}: {here[:6]}")
        if old:
            then = here[old[0] + 1 : old[0] + 2]
            t.check(then and then[0][1] == 0 and then[0][0] - here[old[0]][0] <= 2000, f"its zero within 2 ms: {here[:4]}")
    back_to_driving_if_latched(t, rig, client)
    t.judge(rig)
