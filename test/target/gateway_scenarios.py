# SPDX-License-Identifier: MIT
"""What the image `gateway` must do: a host drives it over the serial line, and the line, the relay and the clients fail in every way."""

import itertools
import json
import random
import zlib
from pathlib import Path

import beginnings
import unicorn
from emulator.can import LEFT
from emulator.chip import MS, PINRSTF, US
from host import Host

ROOT = Path(__file__).resolve().parent.parent.parent
SECOND = 1000 * MS
ZERO = (0, 2000)
LEASE_NS, PERIOD_NS = 200 * MS, 20 * MS
RAMP_NS = 110 * MS  # From 100 mm/s at 1500 mm/s2, and a period.
SPEED = 100
EDGE_TO_ZERO_NS = 5 * MS


def moving(rig, since_ns=0):
    return [frame for frame in rig.setpoints(since_ns) if frame.setpoint()[0] != 0]


def assert_stops(rig, since_ns, within_ns, after_ns=SECOND):
    """The last nonzero setpoint is at most that late, and nothing moves during the run that follows."""
    rig.run(within_ns + after_ns)
    late = moving(rig, since_ns + within_ns)
    assert not late, f"{late[0].setpoint()} {(late[0].time_ns - since_ns) / MS:.1f} ms after"
    assert rig.setpoints(since_ns), "no zeros were sent"


def stopped_at(rig, pressed_ns, what=""):
    """When the first zero after the edge was sent; nothing moves after it."""
    zero = next((frame for frame in rig.setpoints(pressed_ns) if frame.setpoint() == ZERO), None)
    assert zero is not None, f"{what}no zero after the e-stop"
    assert not moving(rig, zero.time_ns), f"{what}motion after the e-stop"
    return zero.time_ns


def stage(host, key, value):
    return host.ask(1, {"cmd": "config", "key": key, "value": value})


def commit(host):
    """Stores the staged values; the board starts again with them."""
    assert host.ask(1, {"cmd": "config", "commit": True})["restarts"]
    host.begin_again()


@beginnings.shared
def start(rig, channel=1):
    host = Host(rig)
    host.begin(channel)
    return host


@beginnings.shared
def start_driving(rig, span_ms=400):
    """A host whose client 1 drives."""
    host = start(rig)
    host.arm()
    host.keep_driving(SPEED, span_ms)
    assert rig.setpoints()[-1].setpoint()[0] == SPEED, "the wheels are not driven"
    return host


def talks(rig):
    """Every request has its answer, a stream of commands drives, and stop ends it."""
    host = start(rig)
    assert host.line_bytes == 4480 and len(host.boot) == 16
    hello = host.ask(1, {"cmd": "hello"})
    assert (hello["state"], hello["client"], hello["rights"]) == ("listening", 1, "drive"), hello
    status = host.ask(1, {"cmd": "status"})
    assert status["state"] == "listening" and status["left"]["heard"] and status["bus"]["bitrate"] == 1_000_000
    assert status["wall_us"] is None and status["lease"]["pid"] is None and status["bus"]["load_permille"] is None
    watched = host.ask(1, {"cmd": "watch", "topics": ["state", "stop", "lease", "frame"], "rate_hz": 100})
    assert watched["topics"] == ["state", "lease", "stop"] and watched["limited"] and watched["rate_hz"] == 8, watched
    terms = host.arm()
    assert terms["state"] == "armed" and terms["lease_ms"] == 200, terms
    host.keep_driving(SPEED, 400)
    applied = host.drive(SPEED)
    assert applied["ok"] and applied["left_mm_s"] == SPEED and not applied["limited"], applied
    assert host.ask(1, {"cmd": "stop"}) == {"id": host.number, "ok": True, "state": "stopping"}
    stop_ns = rig.machine.now_ns
    assert_stops(rig, stop_ns, RAMP_NS)
    assert "requested a stop" in host.ask(1, {"cmd": "why"})["sentence"]
    assert host.events("stop") and host.events("lease")[0]["change"] == "gained" and len(host.events("state")) >= 8
    assert longest_line(host) <= host.line_bytes
    rig.note(f"stack {rig.stack_used()} B, {rig.machine.busy_ns * 100 / rig.machine.now_ns:.1f} % busy, longest line {longest_line(host)} B")


def longest_line(host):
    host.listen()
    return max(len(line.json) + 33 for line in host.lines)


def both_words_and_turns(rig):
    """twist, tare, confirm without an item, invalid requests, and requests that a microcontroller does not have."""
    host = start(rig)
    assert host.ask(1, {"cmd": "nonsense"})["error"] == "unknown_cmd"
    assert host.ask(1, {"cmd": "arm", "speed": 1})["error"] == "unknown_field"
    assert host.ask(1, {"cmd": "stop", "speed": 1})["ok"], "a stop was refused for a field"
    host.say(1, b'{"cmd":"stop","reason":"\\ud83d"}')
    host.wait(lambda line: line.message.get("error") == "bad_json" and "its stop is executed" in line.message["message"])
    assert host.ask(1, {"cmd": "recordings"})["error"] == "denied"
    host.ask(1, {"cmd": "watch", "topics": ["state"]})
    assert host.ask(1, {"cmd": "confirm", "item": "wheel_radius", "value": 194})["state"] == "confirmed"
    assert host.ask(1, {"cmd": "confirm", "item": "wheel_radius", "value": "wide"})["error"] == "bad_value"
    assert host.ask(1, {"cmd": "confirm", "item": "mount_sign_left", "value": "yes"})["state"] == "contradicted"
    assert host.ask(1, {"cmd": "arm"})["error"] == "denied", "armed although an assumption is contradicted"
    assert host.ask(1, {"cmd": "confirm", "item": "mount_sign_left"})["state"] == "confirmed"
    assert host.ask(1, {"cmd": "confirm", "item": "gear_ratio", "value": "2/2"})["state"] == "confirmed"
    rig.run(20 * MS)
    items = [event["item"] for event in host.events("ledger") if event["evidence"] == "operator"]
    assert items == ["wheel_radius", "mount_sign_left", "mount_sign_left", "gear_ratio"], items
    host.ask(1, {"cmd": "watch", "topics": []})
    rig.run(2500 * MS)
    tared = host.ask(1, {"cmd": "tare", "side": "left"})
    assert tared["ok"] and tared["left"]["samples"] > 0, tared
    host.arm()
    body = {"cmd": "twist", "v_mm_s": 100, "yaw_mrad_s": 100, "id": 99}
    host.say(1, host.quoted(1, body))
    turned = host.wait(lambda line: line.message.get("id") == 99).message
    assert (turned["left_mm_s"], turned["right_mm_s"]) == (73, 127), turned
    host.say(1, {"ok": True, "id": 1000})
    host.say(1, {"event": "stop"})
    host.say(0, {"event": "link"})
    rig.run(50 * MS)
    host.listen()
    assert not any(line.message.get("id") == 1000 or line.message.get("error") == "missing_field" for line in host.lines), "an answer was answered"
    assert not host.events("line_error"), "an answer was answered"


def lease_alone(rig):
    """The client sends nothing more while its relay continues: the lease stops the wheels."""
    host = start_driving(rig)
    silent_ns = rig.machine.now_ns
    assert_stops(rig, silent_ns, LEASE_NS + PERIOD_NS + RAMP_NS)
    assert "no drive command" in host.ask(1, {"cmd": "why"})["sentence"]


def close_ends(rig):
    """A closed channel ends its lease immediately."""
    host = start_driving(rig)
    host.say(0, {"cmd": "close", "channel": 1})
    assert_stops(rig, rig.machine.now_ns, PERIOD_NS + RAMP_NS)
    host.open(2)
    assert "disconnected" in host.ask(2, {"cmd": "why"})["sentence"]


def silent_relay(rig):
    """The relay sends nothing for half a second: every channel ends, and must be opened again before the board accepts a client."""
    host = start_driving(rig)
    host.open(2, watch=True)
    host.fall_silent()
    silent_ns = rig.machine.now_ns
    assert_stops(rig, silent_ns, LEASE_NS + PERIOD_NS + RAMP_NS)
    host.say(1, {"cmd": "hello", "id": "late"})
    host.say(2, {"cmd": "hello", "id": "late"})
    rig.run(300 * MS)
    host.listen()
    assert not any(line.message.get("id") == "late" for line in host.lines), "a channel outlived its relay"
    assert host.events("line_error")


def relay_killed_and_anew(rig):
    """Another relay begins: the clients of the one before it have ended, and their commands are old."""
    host = start_driving(rig)
    old = host.drive_line(SPEED, id=7)
    host.say(0, {"cmd": "link"})
    begun_ns = rig.machine.now_ns
    rig.run(PERIOD_NS + RAMP_NS + 30 * MS)
    assert not moving(rig, begun_ns + PERIOD_NS + RAMP_NS), "the clients of the previous relay continue"
    host.open(1)
    host.raw(old)
    assert not host.wait(lambda line: line.message.get("id") == 7).message["ok"]
    assert_stops(rig, begun_ns, PERIOD_NS + RAMP_NS)
    host.arm()
    armed_ns = rig.machine.now_ns
    host.raw(old.replace(b'"id":7', b'"id":8'))  # Its CRC is wrong now; then unchanged:
    host.raw(old)
    assert host.wait(lambda line: line.message.get("id") == 7).message["error"] == "stale_command"
    assert not moving(rig, armed_ns)


def relay_stopped_goes_on(rig):
    """The relay is stopped for 0.3 s and then sends the lines that waited: none of them moves anything, because their stamps are old."""
    host = start_driving(rig)
    host.fall_silent()
    backlog = [host.drive_line(300) for _ in range(15)]
    stopped_ns = rig.machine.now_ns
    rig.run(300 * MS)
    host.raw(b"".join(backlog))
    assert_stops(rig, stopped_ns, LEASE_NS + PERIOD_NS + RAMP_NS)
    assert not [frame for frame in rig.setpoints() if frame.setpoint()[0] > SPEED], "an old command was obeyed"


def stale_in_every_way(rig):
    """Wrong start, old and equal number, old stamp, a stamp of the future, none at all: refused, and the lease runs out anyway."""
    host = start_driving(rig)
    last_ns, old_us, used = rig.machine.now_ns, host.t_us - 250_000, host.seq[1]
    for turn in range(12):
        if turn % 4 == 3:  # The lease has run out meanwhile: armed again, without a command.
            rig.run(2 * SECOND)
            assert not moving(rig, last_ns + LEASE_NS + PERIOD_NS + RAMP_NS)
            host.arm()
        host.drive(SPEED, boot="0123456789abcdef")
        host.drive(SPEED, seq=used)
        host.drive(SPEED, seq=1)
        host.drive(SPEED, t_us=old_us)
        host.drive(SPEED, t_us=host.t_us + 10_000_000)
        host.say(1, {"cmd": "drive", "left_mm_s": SPEED, "right_mm_s": SPEED, "id": -turn})
    rig.run(30 * MS)
    host.listen()
    refused = [line.message for line in host.lines if line.message.get("error") == "stale_command"]
    assert len(refused) >= 40, f"{len(refused)} of 72 were refused as stale"
    assert not [line for line in host.lines if line.message.get("limited") is not None and line.t_us * 1000 > last_ns + 30 * MS], "one was obeyed"
    assert_stops(rig, last_ns, rig.machine.now_ns - last_ns)
    assert not moving(rig, last_ns + LEASE_NS + PERIOD_NS + RAMP_NS)


def each_client_feeds_itself(rig):
    """The board refuses the good commands of a second client, and they do not extend the lease of the first one."""
    host = start_driving(rig)
    host.open(2)
    last_ns = rig.machine.now_ns - 20 * MS
    for _ in range(15):
        assert host.drive(SPEED, channel=2)["error"] in ("not_holder", "not_armed")
        host.ask(2, {"cmd": "hello"})
        rig.run(20 * MS)
    assert_stops(rig, last_ns, LEASE_NS + PERIOD_NS + RAMP_NS + 20 * MS)
    watcher = host.open(3, watch=True)
    assert watcher["rights"] == "watch" and host.ask(3, {"cmd": "arm"})["error"] == "denied"


def estop_random(rig):
    """The button at any phase of loop, line and bus, with a host that drives and sends requests: zero within 5 ms, and motion only after reset, arm and a
    fresh command."""
    host, chance, worst_ns = start_driving(rig), random.Random(21), 0
    host.ask(1, {"cmd": "watch", "topics": ["state", "stop", "estop", "force"], "rate_hz": 100})
    for _ in range(12):
        host.keep_driving(SPEED, 200)
        host.say(1, {"cmd": "status", "id": "big"})
        host.drive(SPEED, wait=False)
        rig.run(chance.randrange(20_000) * US)
        pressed_ns = rig.open_estop()
        host.keep_driving(SPEED, 100)
        zero_ns = stopped_at(rig, pressed_ns)
        worst_ns = max(worst_ns, zero_ns - pressed_ns)
        assert host.ask(1, {"cmd": "reset"})["error"] == "estop_pressed"
        rig.close_estop()
        rig.run(1300 * MS)
        assert host.drive(SPEED)["error"] == "latched"
        rig.run(600 * MS)
        assert host.ask(1, {"cmd": "reset"})["ok"], host.lines[-1].message
        assert not moving(rig, zero_ns), "a reset moved the wheels"
        host.arm()
    assert worst_ns <= EDGE_TO_ZERO_NS, f"first zero {worst_ns / MS:.3f} ms after the edge"
    rig.note(f"edge to zero on the bus at most {worst_ns / MS:.2f} ms")


FLOODS = {
    "config, all keys": {"cmd": "config"},
    "config, one key": {"cmd": "config", "key": "drive.max_speed_mm_s"},
    "config, staged": {"cmd": "config", "key": "drive.max_speed_mm_s", "value": 400},
    "config, refused": {"cmd": "config", "key": "drive.max_speed_mm_s", "value": 5000},
    "config, no such key": {"cmd": "config", "key": "drive.lease", "value": 1},
    "config, discarded": {"cmd": "config", "commit": False},
    "config, committed in motion": {"cmd": "config", "commit": True},
    "hello": {"cmd": "hello"},
    "hello, unknown field": {"cmd": "hello", "name": "a name as long as names may be"},
    "status": {"cmd": "status"},
    "watch": {"cmd": "watch", "topics": ["state", "stop", "estop", "force", "bus", "lease"], "rate_hz": 100},
    "why": {"cmd": "why"},
    "arm": {"cmd": "arm", "name": "again"},
    "arm, takeover": {"cmd": "arm", "name": "again", "takeover": True},
    "drive": lambda host, channel: host.quoted(channel, {"cmd": "drive", "left_mm_s": SPEED, "right_mm_s": SPEED}),
    "drive, void": {"cmd": "drive", "left_mm_s": SPEED, "right_mm_s": SPEED},
    "twist": lambda host, channel: host.quoted(channel, {"cmd": "twist", "v_mm_s": SPEED, "yaw_mrad_s": 0}),
    "stop": {"cmd": "stop"},
    "disarm": {"cmd": "disarm"},
    "estop": {"cmd": "estop", "reason": "a reason that is as long as an operator may write it"},
    "release": {"cmd": "release"},
    "tare": {"cmd": "tare"},
    "confirm": {"cmd": "confirm", "item": "wheel_radius", "value": "192"},
    "record": {"cmd": "record", "on": True},
    "recordings": {"cmd": "recordings"},
    "recording": {"cmd": "recording", "name": "20260101T000000Z-stop.iwr"},
    "reset": {"cmd": "reset"},
    "unknown": {"cmd": "nonsense"},
    "text that is no object": b'[1,2,{"cmd":"drive","left_mm_s":100}]',
    "bytes that are no text": bytes(range(128, 192)),
    "relay: alive": {"cmd": "alive"},
    "relay: open": {"cmd": "open", "channel": 3, "watch": True},
    "relay: close": {"cmd": "close", "channel": 3},
    "relay: link": {"cmd": "link"},
}
ENDS_MOTION = ("stop", "disarm", "estop", "relay: link")


def flood(host, name, lines=40):
    """At least 10 ms of the line, and more than the receive buffer: from the driver's channel and another, or from the relay."""
    for turn in range(lines):
        channel = 0 if name.startswith("relay: ") else 1 + turn % 2
        message = FLOODS[name]
        host.say(channel, message(host, channel) if callable(message) else message)


def estop_in_floods(rig):
    """The line is full of one kind of request: zero within 5 ms of the edge at any phase of the loop. Every request of the protocol is a kind."""
    requests = json.loads((ROOT / "share/northbound.json").read_text())["requests"]
    missing = {*requests} - {name.split(",")[0] for name in FLOODS}
    assert not missing, f"no flood of {missing}"
    host, chance, worst = start_driving(rig), random.Random(49), {}
    for name in FLOODS:
        host.open(2)
        for _ in range(2):
            host.keep_driving(SPEED, 300)
            flood(host, name)
            rig.run(2 * MS + chance.randrange(3000) * US)
            before = rig.setpoints()[-1].setpoint()
            assert before[0] == SPEED or name in ENDS_MOTION, f"{name}: the wheels are not driven"
            pressed_ns = rig.open_estop()
            rig.run(60 * MS)
            host.listen()
            if before != ZERO:
                worst[name] = max(worst.get(name, 0), stopped_at(rig, pressed_ns, f"{name}: ") - pressed_ns)
            assert not moving(rig, pressed_ns + EDGE_TO_ZERO_NS), f"{name}: motion after the e-stop"
            rig.close_estop()
            rig.run(1900 * MS)
            if name == "relay: link":
                host.open(1)
            assert host.ask(1, {"cmd": "reset"}, 600)["ok"], host.lines[-1].message
            host.arm()
    late = {name: round(span_ns / MS, 2) for name, span_ns in worst.items() if span_ns > EDGE_TO_ZERO_NS}
    assert not late, f"first zero later than 5 ms after the edge, in ms: {late}"
    assert {*FLOODS} - {*worst} <= {"estop"}, "a kind was never judged in motion"
    rig.note("edge to zero in ms at most: " + ", ".join(f"{name} {span_ns / MS:.2f}" for name, span_ns in worst.items()))


def software_estop(rig):
    """estop needs no lease; its reason is reported; reset and arm do not move the wheels."""
    host = start_driving(rig)
    host.open(2, watch=True)
    assert host.ask(2, {"cmd": "estop", "reason": "test of it"})["state"] == "latched"
    pressed_ns = rig.machine.now_ns
    assert_stops(rig, pressed_ns, PERIOD_NS)
    assert "test of it" in host.ask(2, {"cmd": "why"})["sentence"]
    assert host.ask(1, {"cmd": "arm"})["error"] == "latched"
    rig.run(500 * MS)
    assert host.ask(1, {"cmd": "reset"})["state"] == "listening"
    rig.run(100 * MS)
    host.arm()
    rig.run(100 * MS)
    assert not moving(rig, pressed_ns + PERIOD_NS), "reset or arm moved the wheels"


def reset_in_motion(rig):
    """Both resets while the wheels turn: zeros first, another boot, and earlier commands do not extend the lease."""
    host = start_driving(rig)
    boots = {host.boot}
    for reset in (lambda: rig.machine.reset("pin", PINRSTF), rig.machine.divert):
        reset()
        reset_ns = rig.machine.now_ns
        old = host.boot
        for _ in range(20):  # The relay continues as before.
            host.drive(SPEED, wait=False, boot=old)
            rig.run(20 * MS)
        if len(boots) == 1:
            after = rig.setpoints(reset_ns)
            assert after and not moving(rig, reset_ns), "the wheels were not commanded to zero"
        else:
            hung = [when for when, cause in rig.machine.resets if cause == "watchdog"]
            assert hung and not moving(rig, hung[-1]), "the wheels were not commanded to zero"
        rig.run(1800 * MS)
        host.rest = b""  # The reset cut a line.
        host.uart.sent.clear()
        host.say(0, {"cmd": "link"})
        host.wait(lambda line: line.channel == 0 and line.message.get("event") == "link")
        assert host.boot not in boots, "a start has the name of another"
        boots.add(host.boot)
        host.t_us = host.lines[-1].t_us
        host.open(1)
        host.arm()
        host.keep_driving(SPEED, 300)
        assert rig.setpoints()[-1].setpoint()[0] == SPEED
    rig.expect_resets("pin", "watchdog")


def keys_of(reply):
    return {entry["key"]: entry["value"] for entry in reply["keys"]}


def config_in_flash(rig):
    """What is wrong or a daemon's is refused by name, nothing is written while anything is sent, and what is committed is in force after the start
    that follows it, and after power-off."""
    host = start(rig)
    first = host.ask(1, {"cmd": "config"})
    assert keys_of(first)["drive.lease_ms"] == "200" and keys_of(first)["wheels.setpoint_type"] == "1" and not first["staged"], first
    for key, value, words in (
        ("bus.interface", "can0", "no key of a board"),
        ("drive.lease", "200", "no key"),
        ("drive.lease_ms", "5000", "20 to 500"),
        ("wheels.gear_ratio", "1/x", "N or N/M"),
        ("left.invert", "maybe", "no or yes"),
        ("drive.lease_ms", "2e2", "20 to 500"),
    ):
        refused = stage(host, key, value)
        assert refused["error"] == "bad_value" and words in refused["message"], refused
    stage(host, "drive.max_speed_mm_s", 5000)
    assert "exceeds 1000 ms" in host.ask(1, {"cmd": "config", "commit": True})["message"]
    assert keys_of(host.ask(1, {"cmd": "config", "commit": False})) == keys_of(first)
    host.arm()
    host.keep_driving(SPEED, 200)
    for key, value in (
        ("drive.lease_ms", 300),
        ("wheels.gear_ratio", "31/2"),
        ("wheels.track_mm", 600),
        ("right.invert", "yes"),
        ("wheels.current_role", "limit"),
    ):
        assert stage(host, key, value)["staged"]
    assert host.ask(1, {"cmd": "config", "commit": True})["error"] == "denied", "written while the wheels turn"
    host.ask(1, {"cmd": "stop"})
    rig.run(300 * MS)
    assert host.ask(1, {"cmd": "config", "commit": True})["error"] == "denied", "written in the hold"
    rig.run(2 * SECOND)
    before, boot = rig.machine.flash.erasures, host.boot
    commit(host)
    assert rig.machine.flash.erasures == before and host.boot != boot
    wanted = {**keys_of(first), "drive.lease_ms": "300", "wheels.gear_ratio": "31/2", "wheels.track_mm": "600", "right.invert": "yes"}
    assert keys_of(host.ask(1, {"cmd": "config"})) == wanted
    host.power_cycle()
    assert keys_of(host.ask(1, {"cmd": "config"})) == wanted and host.ask(1, {"cmd": "status"})["lease"]["lease_ms"] == 300
    assert host.arm()["lease_ms"] == 300
    rig.expect_resets("software", "power")


def power_cut_while_writing(rig):
    """Power fails after any number of words of a commit, and during the counting of a power-on: the configuration is the old or the new one, and
    no two starts have one name."""
    host, boots, value, resets = start(rig), set(), 200, 0
    cuts = range(0, 130, 9) if rig.machine.flash.unit == 2 else range(0, 66, 5)
    for cut in cuts:
        assert host.boot not in boots, "two starts have one name"
        boots.add(host.boot)
        value += 1
        stage(host, "drive.lease_ms", value)
        rig.machine.flash.cut_after, rig.machine.flash.eccr_lost = cut, cut % 2
        host.say(1, {"cmd": "config", "commit": True})
        rig.run(100 * MS)
        if rig.machine.flash.cut_after is not None:  # The commit was complete before.
            rig.machine.flash.cut_after, rig.machine.flash.next_cut = None, cut // 2  # And now the counting of the next power-on.
            rig.machine.lose_power()
        host.begin_again()
        now = int(keys_of(host.ask(1, {"cmd": "config"}))["drive.lease_ms"])
        assert value - 1 <= now <= value, f"lease_ms is {now}, neither {value - 1} nor {value}"
        value = now
        resets = len(rig.machine.resets)
    rig.expect_resets(*(cause for _, cause in rig.machine.resets))
    assert resets >= len(cuts) and set(rig.expected_resets) <= {"power", "software"}
    rig.note(f"{len(cuts)} cuts, {rig.machine.flash.erasures} erasures")


def hardware_watchdog(rig):
    """An option byte starts the watchdog at each reset: a start that erases a page completes it."""
    machine, flash = rig.machine, rig.machine.flash
    slots = 16 * 1024 if flash.unit == 4 else 1024
    flash.memory[: slots - 256] = bytes(slots - 256)  # One slot of the first page is blank.
    machine.watchdog.by_hardware, machine.watchdog.lsi_hz = True, machine.board.lsi_limits_hz[1]
    machine.watchdog.reset()
    rig.run(3 * SECOND)
    host = start(rig)
    assert flash.erasures == 1, f"{flash.erasures} erasures"
    assert machine.watchdog.timeout_ns() < 200 * MS, "the period stayed extended"
    host.arm()


def change_stored(flash, old, new):
    """Replaces the first value `old` in the newest record, with its CRC, as if another version had stored it."""
    size = flash.word_bytes
    stored = b"".join(flash.memory[at : at + 4] for at in range(0, len(flash.memory), size))
    slots = [stored[at : at + 256] for at in range(0, len(stored), 256)]
    sequences = [int.from_bytes(slot[:4], "little") for slot in slots]
    newest = max((sequence, at) for at, sequence in enumerate(sequences) if sequence != 0xFFFFFFFF)[1]
    slot = slots[newest][:252].replace(old.to_bytes(2, "little"), new.to_bytes(2, "little"), 1)
    slot += zlib.crc32(slot).to_bytes(4, "little")
    for word in range(64):
        value = slot[4 * word : 4 * word + 4]
        at = (64 * newest + word) * size
        flash.memory[at : at + size] = (value + bytes(byte ^ 0xFF for byte in value))[:size]


def refused_record(rig):
    """A stored value that this version does not accept: the board sends nothing, names the value, and retains the other keys."""
    host = start(rig)
    for key, value in (("wheels.radius_mm", 259), ("right.invert", "yes")):
        stage(host, key, value)
    commit(host)
    change_stored(rig.machine.flash, 259, 401)
    host.power_cycle()
    sent = len(rig.setpoints())
    refused = host.ask(1, {"cmd": "arm"})
    assert refused["message"] == "stored settings not in force: wheels.radius_mm must be 60 to 400", refused
    rig.run(3 * SECOND)
    assert len(rig.setpoints()) == sent, "it sends"
    staged = keys_of(stage(host, "wheels.radius_mm", 260))
    assert staged["right.invert"] == "yes", staged
    commit(host)
    now = keys_of(host.ask(1, {"cmd": "config"}))
    assert now == staged and now["wheels.radius_mm"] == "260", now
    host.arm()
    rig.expect_resets("software", "power", "software")


def stored_in_flash(rig):
    """The board stores observations of the wheels only after two seconds without setpoints, restores them with their provenance after
    power-off, and drops them with the setting for which they were found."""
    host, flash = start(rig), rig.machine.flash
    assert host.ask(1, {"cmd": "status"})["memory"] == {"file": "flash", "state": "new", "reason": None}
    host.ask(1, {"cmd": "watch", "topics": ["force"], "rate_hz": 1})
    host.arm()
    before = flash.operations
    host.keep_driving(SPEED, 3000)
    assert host.ask(1, {"cmd": "confirm", "item": "wheel_radius"})["state"] == "confirmed"
    host.ask(1, {"cmd": "stop"})
    while host.ask(1, {"cmd": "status"})["state"] != "listening":
        assert flash.operations == before, "written while something can move"
        rig.run(20 * MS)
    rig.run(1900 * MS)
    assert flash.operations == before, "written before two seconds without setpoints have passed"
    rig.run(300 * MS)
    assert flash.operations > before, "not written"
    rig.run(2 * SECOND)  # A tare needs two seconds at standstill.
    tared = host.ask(1, {"cmd": "tare", "side": "left"})["left"]["offset_mN"]
    rig.run(20 * MS)
    reported = host.events("offset")
    assert reported and (reported[-1]["side"], reported[-1]["provenance"], reported[-1]["offset_mN"]) == ("left", "operator", tared), reported
    rig.run(2300 * MS)
    now = flash.operations
    rig.run(5 * SECOND)
    assert flash.operations == now, "the same is written again"
    stack = rig.stack_used()
    host.power_cycle()
    rig.run(600 * MS)
    status = host.ask(1, {"cmd": "status"})
    left, assumptions = status["left"], status["ledger"]
    assert status["memory"]["state"] == "kept"
    assert (left["offset_provenance"], left["offset_origin"], left["force_offset_mN"], left["offset_samples"]) == ("stored", "operator", tared, 40), left
    assert assumptions["wheel_radius"] == {"state": "confirmed", "evidence": "operator"}, assumptions["wheel_radius"]
    assert assumptions["dlc"]["state"] == "confirmed" and assumptions["dlc"]["evidence"] == "bus"
    stage(host, "wheels.radius_mm", 180)
    commit(host)
    status = host.ask(1, {"cmd": "status"})
    assert status["ledger"]["wheel_radius"]["state"] == "assumed" and status["left"]["force_offset_mN"] == tared
    rig.expect_resets("power", "software")
    rig.note(f"stack {stack} B")


def power_cut_while_learning(rig):
    """Power fails after any number of stored words: the board restores the old or the new record, and retains the configuration."""
    host, says, known = start(rig), True, "assumed"
    stage(host, "drive.lease_ms", 250)
    commit(host)
    cuts = (*range(0, 125, 14), 140, 30, 140) if rig.machine.flash.unit == 2 else (*range(0, 62, 7), 70, 30, 70)
    for cut in cuts:
        says = known != "confirmed"
        host.ask(1, {"cmd": "confirm", "item": "track", **({} if says else {"value": 700})})
        rig.machine.flash.cut_after = cut
        rig.run(2500 * MS)
        rig.machine.flash.cut_after = None
        host.power_cycle()
        now, status = keys_of(host.ask(1, {"cmd": "config"})), host.ask(1, {"cmd": "status"})
        assert now["drive.lease_ms"] == "250", now
        after = status["ledger"]["track"]["state"]
        assert after in (known, "confirmed" if says else "contradicted"), f"{known} became {after}"
        known = after
    rig.expect_resets(*(cause for _, cause in rig.machine.resets))
    assert known != "assumed", "nothing was ever stored"
    rig.note(f"{len(cuts)} cuts, {rig.machine.flash.erasures} erasures")


def fault_of(host):
    """(cause, address) of the event link, or None."""
    events = host.events("link", 0)
    return (events[-1]["fault_cause"], events[-1]["fault_pc"]) if "fault_cause" in events[-1] else None


def assert_zeros_first(rig, failed_ns):
    assert rig.setpoints(failed_ns)[0].time_ns - failed_ns < 50 * MS and not moving(rig, failed_ns), "no zeros first"


def fault_is_reported(rig):
    """A fault in motion: zeros first, and the next starts report its cause and address, also after power-off. A fault that repeats itself does not wear
    out the flash."""
    host, machine = start_driving(rig), rig.machine
    assert fault_of(host) is None

    def fault(address):
        while machine.active:
            rig.run(US)
        machine.cpu.reg_write(machine.PC, address)
        machine.sleeping = False
        rig.run(US)

    fault(0x60000000)
    failed_ns = machine.now_ns
    host.begin_again()
    assert_zeros_first(rig, failed_ns)
    assert fault_of(host) == (3 << 26 | 1 << 8, 0x60000000), fault_of(host)
    operations = machine.flash.operations
    rig.run(2 * SECOND)
    fault(0x60000010)
    host.begin_again()
    assert fault_of(host) == (3 << 26 | 1 << 8, 0x60000010), "the newest fault is not reported"
    assert machine.flash.operations == operations, "each fault is written to the flash"
    host.power_cycle()
    assert fault_of(host) == (3 << 26 | 1 << 8, 0x60000000), "the first fault did not survive power-off"
    host.power_cycle()
    assert fault_of(host) is None, "an old fault is reported for ever"
    rig.expect_resets("software", "software", "power", "power")


def program_unreadable(rig):
    """In motion the flash reports that it cannot correct a word of the program: zeros first, and the next start reports the NMI."""
    host, machine = start_driving(rig), rig.machine
    machine.flash.report(1 << 31)
    failed_ns = machine.now_ns
    host.begin_again()
    assert_zeros_first(rig, failed_ns)
    assert fault_of(host)[0] >> 26 == 2, fault_of(host)
    rig.expect_resets("software")


def reads_the_ram_first(rig):
    """After a reset the image reads the RAM before it writes a variable, because a G474 can lose the first write."""
    machine, accesses = rig.machine, []
    machine.reset("pin", PINRSTF)
    machine.cpu.ctl_flush_tb()  # Code that was translated without the hook does not call it.
    kinds = unicorn.UC_HOOK_MEM_READ | unicorn.UC_HOOK_MEM_WRITE
    end = 0x20000000 + machine.board.ram_size - 1
    hook = machine.cpu.hook_add(kinds, lambda cpu, kind, *rest: accesses.append(kind), begin=rig.stack_area[1], end=end)
    rig.run(20 * US)
    machine.cpu.hook_del(hook)
    assert accesses and accesses[0] == unicorn.UC_MEM_READ, "the first access to the RAM is a write"
    rig.expect_resets("pin")


def bus_off_driven(rig):
    """Bus-off with a host: the board latches and reports it, and nothing moves when the bus is back."""
    host = start_driving(rig)
    host.ask(1, {"cmd": "watch", "topics": ["stop", "bus"]})
    rig.machine.bus.corrupt_chip = True
    off_ns = rig.machine.now_ns
    host.keep_driving(SPEED, 40)
    rig.machine.bus.corrupt_chip = False
    host.keep_driving(SPEED, 400)
    assert rig.counter("bus_offs") >= 1 and rig.machine.can.is_on(), "no bus-off"
    assert not moving(rig, off_ns), "motion after bus-off"
    assert host.drive(SPEED)["error"] == "latched"
    assert host.events("stop")[-1]["cause"] in ("bus_down", "send_stalled")


def damaged(chance, line):
    """One of the ways in which a line arrives changed."""
    data, way = bytearray(line), chance.randrange(6)
    at = chance.randrange(len(data) - 1)
    if way == 0:
        data[at] ^= 1 << chance.randrange(8)
    elif way == 1:
        del data[at : at + chance.randrange(1, 20)]
    elif way == 2:
        data[at:at] = bytes(chance.randrange(256) for _ in range(chance.randrange(1, 12)))
    elif way == 3:
        data = data[:at] + b"\n"
    elif way == 4:
        data = data[at:]
    else:
        other = chance.randrange(len(data) - 1)
        data[at], data[other] = data[other], data[at]
    return bytes(data)


def hostile_line(rig):
    """Some thousand damaged, cut, doubled and delayed commands to move, at full rate, while armed: none is obeyed, and the lease runs out."""
    host, chance = start(rig), random.Random(4)
    host.arm()
    host.keep_driving(SPEED, 200)
    captured, begun_ns = [], rig.machine.now_ns
    good = None
    count = 0
    for _ in range(60):
        for _ in range(12):
            good = host.drive_line(777)
            captured.append(good)
            bad = damaged(chance, good)
            host.raw(bad if bad.rstrip(b"\n") != good.rstrip(b"\n") else b"\n")
            count += 1
        rig.run(20 * MS)
    assert not [frame for frame in rig.setpoints() if frame.setpoint()[0] > SPEED], "a damaged line was obeyed"
    assert not moving(rig, begun_ns + LEASE_NS + PERIOD_NS + RAMP_NS), "damaged lines extended the lease"
    reported = host.events("line_error")
    assert reported and len(reported) <= 2 + 5 * (rig.machine.now_ns - begun_ns) / SECOND, f"{len(reported)} line_errors"
    assert host.ask(1, {"cmd": "hello"}, 500)["ok"], "the line did not recover"
    host.arm()
    for line in captured[::9]:
        host.raw(line)
        count += 1
        rig.run(5 * MS)
    assert not [frame for frame in rig.setpoints() if frame.setpoint()[0] > SPEED], "an old line was obeyed"
    host.drive(50)
    fresh = host.drive_line(60)
    for _ in range(50):  # Doubled: obeyed once, fed once.
        host.raw(fresh)
        count += 1
        rig.run(10 * MS)
    assert not moving(rig, rig.machine.now_ns - 100 * MS), "one command, doubled, extended the lease"
    rig.note(f"{count} bad lines")


def noise_on_the_wire(rig):
    """Bytes that the chip itself detects as damaged, and a flood of random bytes: the e-stop still works in time."""
    host = start_driving(rig)
    for _ in range(30):
        rig.machine.uart.disturb()
        host.drive(SPEED, wait=False)
        rig.run(10 * MS)
    host.raw(bytes(random.Random(1).randrange(256) for _ in range(20000)))
    rig.run(3 * MS)
    pressed_ns = rig.open_estop()
    rig.run(300 * MS)
    assert stopped_at(rig, pressed_ns) - pressed_ns <= EDGE_TO_ZERO_NS


def another_rate(rig):
    """The slowest and the fastest line: a stream of commands drives over it without a gap, and the e-stop is in time."""
    host = start(rig)
    host.arm()
    host.keep_driving(SPEED, 200)
    begun_ns = rig.machine.now_ns + 200 * MS
    host.keep_driving(SPEED, 1000)
    frames = rig.setpoints(begun_ns)
    assert len(frames) > 70 and all(frame.setpoint()[0] == SPEED for frame in frames), "the line did not carry the commands in time"
    assert host.ask(1, {"cmd": "status"}, 600)["state"] == "armed" and not host.events("line_error")
    host.keep_driving(SPEED, 40)
    pressed_ns = rig.open_estop()
    rig.run(100 * MS)
    assert stopped_at(rig, pressed_ns) - pressed_ns <= EDGE_TO_ZERO_NS


def dma_errors(rig):
    """A bus error disables a channel of the DMA. Receiving: it starts again within the lease, and the damage is reported. Sending: one line is cut."""
    host, uart, dma = start_driving(rig), rig.machine.uart, rig.machine.dma
    failed_ns = rig.machine.now_ns
    dma.receive.fail()
    host.keep_driving(SPEED, 600)
    assert all(frame.setpoint()[0] == SPEED for frame in rig.setpoints(failed_ns)), "the board did not receive again"
    assert host.events("line_error"), "the damage was not reported"
    host.say(1, {"cmd": "status"})
    while not dma.transmit.is_on() or dma.transmit.left < 1000:
        rig.run(US)
    dma.transmit.fail()
    rig.run(2 * MS)
    host.drive(SPEED, wait=False)
    rig.run(10 * MS)
    cut, *texts = (host.rest + bytes(uart.sent)).split(b"\n")
    host.rest = b"\n".join(texts)
    uart.sent.clear()
    assert b'"ok":true' in cut and len(texts) >= 1, "no line was cut"
    assert host.drive(SPEED)["ok"] and host.ask(1, {"cmd": "status"})["state"] == "armed", "the board does not send any more"


def crowd(rig):
    """Eight clients watch and send requests continuously: the driver drives, replies precede events, losses are reported."""
    host = start(rig)
    host.arm()
    for channel in range(2, 9):
        host.open(channel, watch=channel % 2 == 0)
        host.ask(channel, {"cmd": "watch", "topics": ["state", "force", "stop", "bus", "lease", "estop"], "rate_hz": 100})
    begun_ns = rig.machine.now_ns
    for turn in range(100):
        for channel in range(2, 9):
            host.say(channel, {"cmd": "status", "id": turn})
        host.drive(SPEED, wait=False)
        rig.run(20 * MS)
        host.listen()
    frames = rig.setpoints(begun_ns + 200 * MS)
    assert frames and all(frame.setpoint()[0] == SPEED for frame in frames), "the eight clients disturbed the driver"
    times = [frame.time_ns for frame in frames if frame.id == LEFT]
    gap_ns = max(b - a for a, b in itertools.pairwise(times))
    assert gap_ns < 30 * MS, f"a gap of {gap_ns / MS:.1f} ms"
    assert host.events("lost"), "losses were not reported"
    served = {line.channel for line in host.lines if line.message.get("id") is not None and "left" in line.message}
    assert served >= set(range(2, 9)), f"only {served} had a snapshot"
    rig.note(f"worst gap between setpoints {gap_ns / MS:.1f} ms")


SCENARIOS = (
    talks,
    both_words_and_turns,
    lease_alone,
    close_ends,
    silent_relay,
    relay_killed_and_anew,
    relay_stopped_goes_on,
    stale_in_every_way,
    each_client_feeds_itself,
    estop_random,
    estop_in_floods,
    software_estop,
    reset_in_motion,
    config_in_flash,
    refused_record,
    power_cut_while_writing,
    stored_in_flash,
    power_cut_while_learning,
    hardware_watchdog,
    fault_is_reported,
    bus_off_driven,
    hostile_line,
    noise_on_the_wire,
    dma_errors,
    crowd,
)
OF_G474 = (program_unreadable, reads_the_ram_first)
LONG = (both_words_and_turns, estop_random, estop_in_floods, hostile_line, crowd, reset_in_motion, each_client_feeds_itself, power_cut_while_learning)
