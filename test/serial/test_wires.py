# SPDX-License-Identifier: MIT
"""Faults between a client and a board: no command is obeyed late, and every broken part stops the wheels."""

import contextlib
import json
import os
import random
import signal
import socket
import subprocess
import threading
import time

from bus import now_us
from client import Closed
from judge_log import Event, percentile
from rig import framed, mutated
from scenario import scenario

LEASE_US = 200_000
STOP_AGAIN_US = 150_000  # SERIAL_AGAIN_US of the relay
SEEN_US = 60_000  # the bus log has what happened until then


def begin(t):
    """Starts a rig and arms a client."""
    rig, client = t.running()
    t.arm(client)
    return rig, client


def begin_driving(t, *drive):
    """The same, and the client drives with these arguments of `drive_for`."""
    rig, client = begin(t)
    t.drive_for(client, *drive)
    return rig, client


def raw_drive(number, speed):
    return b'{"cmd":"drive","id":%d,"left_mm_s":%d,"right_mm_s":%d}\n' % (number, speed, speed)


def note_drives(rig, first_us, replies):
    for reply in replies:
        if "left_mm_s" in reply:
            rig.timeline.append(Event(first_us, "drive", now_us(), reply["ok"], reply["left_mm_s"], reply["right_mm_s"]))


def read_replies(client, count, seconds=3.0):
    replies, end = [], time.monotonic() + seconds
    while len(replies) < count and time.monotonic() < end:
        reply = client.read_reply(0.2)
        if reply is not None:
            replies.append(reply)
    return replies


def end_well(t, rig, client=None):
    client = client or rig.client()
    t.silence(rig, client, 6, "nothing is sent at the end")
    t.judge(rig)


def stop_well(t, rig, client):
    t.expect(client.request("stop"))
    end_well(t, rig, client)


def all_closed(t, rig, clients, tries, what):
    """Drives on in spite of a restart of the board, until each client is closed."""
    closed = 0
    for client in clients:
        try:
            for number in range(tries):
                client.send_raw(raw_drive(number, 250))
                client.read_line(0.05)
        except (Closed, OSError):
            closed += 1
    t.check(closed == len(clients), f"{closed} of {len(clients)} clients were closed after {what}: {rig.gateway.text()[-300:]}")


@scenario("a client drives, watches and stops through the relay, and gets the replies of a gateway", 5)
def drive(t):
    rig, client = begin(t)
    t.check(client.events or client.collect(0.1), "a hello on connecting")
    hello = client.request("hello")
    t.check(hello["api"] == 1 and hello["rights"] == "drive", f"{hello}")
    other = rig.client()
    t.expect(other.request("watch", topics=["stop", "lease", "force"], rate_hz=10))
    t.drive_for(client, 250, 250, 1.0)
    t.check(rig.moving(now_us() - 100_000), "the wheels are driven")
    tell_speed(t, rig, client)
    t.expect(other.drive(100, 100), "not_holder")
    t.expect(client.request("stop"))
    t.check(other.wait_event("stop"), "the watcher receives the stop")
    t.check(client.request("why")["cause"] == "client_stop", "why")
    t.expect(client.request("recordings"), "denied")
    client.send_raw(b'{"cmd":"drive","id":"x"}\n{"cmd":"nothing","id":7}\n{"id":8,"cmd":"hello" }\nnonsense\n')
    replies = read_replies(client, 4)
    t.check([r.get("id") for r in replies] == ["x", 7, 8, None], f"answers in their order, with the client's ids: {replies}")
    t.check([r.get("error") for r in replies] == ["missing_field", "unknown_cmd", None, "bad_json"], f"{replies}")
    end_well(t, rig, client)


def tell_speed(t, rig, client):
    """Measures the time from a command to its reply and the relay's processor time, with 20 commands a second and a watcher."""
    spans_us, begin_s, begin_us = [], rig.gateway.cpu_seconds(), now_us()
    for _ in range(40):
        sent_us = now_us()
        t.expect(client.drive(250, 250))
        spans_us.append(now_us() - sent_us)
        time.sleep(0.05)
    share = (rig.gateway.cpu_seconds() - begin_s) * 1e8 / (now_us() - begin_us)
    t.figure(
        f"a drive is answered in {percentile(spans_us, 50) / 1000:.1f} ms, p99 {percentile(spans_us, 99) / 1000:.1f} ms; relay {share:.1f} % of a processor"
    )


@scenario("a stop in a line that is not valid JSON stops the wheels, and is refused", 8)
def bad_stop(t):
    rig, client = begin(t)
    for line, verb in ((b'{"cmd":"stop","reason":"\\ud83d"}\n', "stop"), (b'{"id":1,"id":1,"cmd":"estop"}\n', "estop")):
        t.drive_for(client, 250, 250, 0.6)
        sent_us = now_us()
        client.send_raw(line)
        reply = client.read_reply(3.0)
        rig.timeline.append(Event(sent_us, verb, now_us()))
        t.check(reply and reply["error"] == "bad_json" and "its stop is executed" in reply["message"], f"{line}: {reply}")
        state = client.request("status")["state"]
        t.rule(state == ("latched" if verb == "estop" else "stopping"), f"{line}: {state}")
        if verb == "estop":
            t.reset(client)
        t.silence(rig, client, 6)
        t.arm(client)
    stop_well(t, rig, client)


def refuse_older_release(t, stop):
    """A client requests the end of the hold. While that request waits behind another one, `stop` stops the wheels: the hold continues."""
    rig, client = t.running({"drive": {"after_stop": "hold"}})
    other = rig.client()
    t.check(other.wait_event("hello"), "the other client is welcomed")
    t.arm_and_drive(client, 200, 200, 0.4)
    t.expect(client.request("stop"))
    t.check(rig.wait_status(client, lambda s: s["holding"] and s["left"]["at_rest"] and s["right"]["at_rest"], 6), "the zeros are held at standstill")
    rig.cable.held = True
    time.sleep(0.03)  # The cable has delivered the bytes that it held.
    client.send_raw(b'{"cmd":"status","id":901}\n{"cmd":"release","id":902}\n')
    time.sleep(0.1)
    stop(rig, other)
    time.sleep(0.05)
    rig.cable.held = False
    replies = {reply["id"]: reply for reply in read_replies(client, 2)}
    time.sleep(0.1)
    begin_us = now_us()
    time.sleep(0.4)
    t.rule(len(rig.bus.setpoints(begin_us)) > 20, f"the zeros of the hold continue: {replies.get(902)}")
    t.check(replies[901]["ok"] and replies[902].get("error") == "stale_command", f"{replies[902]}")
    t.reset(client)
    t.expect(client.request("release"))
    t.silence(rig, client)


@scenario("a release that waits while another client presses the e-stop is not executed: the hold continues", 9)
def release_before_estop(t):
    def estop(rig, other):
        rig.note("estop", done_us=now_us() + 300_000)
        other.send_raw(b'{"cmd":"estop","id":1}\n')

    refuse_older_release(t, estop)


@scenario("a release that waits while the e-stop of the board is pressed is not executed: the hold continues", 9)
def release_before_press(t):
    def press(rig, _):
        rig.press()
        time.sleep(0.03)
        rig.release()

    refuse_older_release(t, press)


@scenario("a client that is killed while it drives loses its lease immediately", 3)
def client_killed(t):
    rig, client = begin_driving(t, 250, 250, 0.6)
    gone_us = now_us()
    client.close()
    rig.timeline.append(Event(gone_us, "gone"))
    time.sleep(0.3)
    status = rig.client().request("status")
    t.check(status["lease"]["holder"] is None, f"no client holds the lease: {status['lease']}")
    end_well(t, rig)


@scenario("a relay that was stopped obeys no command that waited", 9)
def relay_stopped(t):
    rig, client = begin(t)
    for span in (0.6, 0.25, 1.5)[: rig.times(3)]:
        t.arm_and_drive(client, 200, 200, 0.4)
        rig.gateway.signal(signal.SIGSTOP)
        for number in range(100_000, 100_000 + int(span * 40)):  # Its socket accepts 70 commands without waiting.
            client.send_raw(raw_drive(number, 200))
            time.sleep(0.025)
        resumed_us = now_us()
        rig.gateway.signal(signal.SIGCONT)
        try:
            replies = read_replies(client, number - 99_999)
            late = [r for r in replies if r.get("id", 0) >= 100_000 and r["ok"]]
            t.check(not late, f"after {span} s {len(late)} waiting commands were obeyed: {late[:1]}")
            t.check(replies and all(r["error"] in ("stale_command", "not_armed") for r in replies), f"{replies[:2]}")
        except Closed:
            t.check(span > 0.3, f"closed after {span} s")
            client = rig.client()
        time.sleep(0.5)
        t.check(not rig.moving(resumed_us + 250_000), f"no motion begins after {span} s without commands")
        t.silence(rig, client, 6, "listening")
    t.judge(rig)


@scenario("a relay that is killed stops the wheels within the lease, and the next one serves immediately", 5)
def relay_killed(t):
    rig, _ = begin_driving(t, 250, 250, 0.6)
    rig.gateway.signal(signal.SIGKILL)
    rig.gateway.wait(2)
    rig.note("ramp", within_us=LEASE_US)
    rig.start_relay()
    t.check(rig.await_relay("board on "), f"the next relay finds the board: {rig.gateway.text()}")
    fresh = rig.client()
    t.expect(fresh.drive(100, 100), "not_armed")
    rig.wait_status(fresh, lambda s: s["state"] == "listening", 6)
    t.arm_and_drive(fresh, 150, 150, 0.3)
    stop_well(t, rig, fresh)


@scenario("the cable is pulled at any byte: the wheels stop, and the next plug is served", 12)
def cable_pulled(t):
    rig, client = begin(t)
    chance = random.Random(21)
    for turn in range(rig.times(6)):
        t.drive_for(client, 200, 200, 0.3)
        rig.cable.cut_after = 1 + chance.randrange(200)
        try:
            while True:
                client.drive(200, 200)
                time.sleep(0.01)
        except (Closed, OSError, TimeoutError):
            pass
        rig.note("ramp", within_us=LEASE_US)
        rig.cable.pull()
        while rig.cable.master is not None:
            time.sleep(0.001)
        for _ in range(20):  # The relay may notice the missing plug a moment later.
            reply = rig.client().read_reply(1.0)
            if reply and ("plug" in reply["message"] or "gone" in reply["message"]):
                break
            time.sleep(0.05)
        t.check(reply and reply["error"] == "bus_down" and ("plug" in reply["message"] or "gone" in reply["message"]), f"without a cable: {reply}")
        time.sleep(0.3)
        rig.cable.plug()
        client = await_service(t, rig)
        t.silence(rig, client, 6, f"listening after pull {turn}")
        t.arm(client)
    stop_well(t, rig, client)


def await_service(t, rig, seconds=5.0):
    """Waits for a client that the board has welcomed."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        client = rig.client()
        try:
            if client.wait_event("hello", 1.0):
                return client
        except (Closed, OSError):
            pass
        time.sleep(0.05)
    t.check(False, f"no service within {seconds} s: {rig.gateway.text()[-500:]}")
    return rig.client()


@scenario("a board that is reset in motion closes all clients, and obeys none of them after it", 6)
def board_reset(t):
    rig, client = begin(t)
    watcher = rig.watcher()
    watcher.wait_event("hello")
    t.drive_for(client, 250, 250, 0.5)
    rig.note("end")
    rig.board.signal(signal.SIGHUP)
    rig.note("start")
    rig.note("restart_hold", within_us=300_000)
    all_closed(t, rig, (client, watcher), 40, "a reset")
    client = await_service(t, rig)
    t.expect(client.drive(100, 100), "not_armed")
    t.check(rig.wait_status(client, lambda s: s["state"] == "listening" and s["left"]["at_rest"], 6), "listening")
    t.arm_and_drive(client, 150, 150, 0.3)
    stop_well(t, rig, client)


@scenario("100 000 corrupted, cut, doubled and late lines move nothing", 14, native="a flood")
def bad_lines(t):
    send_bad_lines(t, 100_000, 500)


def send_bad_lines(t, count, block_lines):
    rig, client = begin_driving(t, 200, 200, 1.0)
    t.expect(client.request("stop"))
    t.silence(rig, client, 6, "listening")
    time.sleep(0.4)
    drives = [line + b"\n" for line in bytes(rig.cable.from_relay).split(b"\n") if b'"drive"' in line]
    t.check(len(drives) > 10 and all(b'"boot"' in line and b'"t_us"' in line for line in drives), f"{drives[:1]}")
    chance, before_us = random.Random(7), now_us()
    t.arm(client)
    rig.note_after(1_000_000, "ramp", within_us=LEASE_US)  # The first lease ends without a command.
    sent = 0
    while sent < count:
        block = b"".join(mutated(chance.choice(drives), chance) for _ in range(block_lines))
        rig.cable.ask(b"\n" + block + b"\n")
        sent += block_lines
        if sent % (4 * block_lines) == 0:
            client.request("hello")
    t.check(client.request("hello")["ok"], "the line works after them")
    time.sleep(0.2)
    t.rule(not rig.moving(before_us), f"{len(rig.moving(before_us))} moving setpoints from bad or late lines")
    errors = bytes(rig.cable.from_board).count(b'"line_error"')
    t.check(0 < errors <= 5 * (now_us() - before_us) / 1e6 + 2, f"{errors} line_errors in {(now_us() - before_us) / 1e6:.1f} s")
    t.figure(f"{sent} lines in {(now_us() - before_us) / 1e6:.1f} s, {errors} answers")
    t.silence(rig, client, 6, "listening")
    t.arm_and_drive(client, 150, 150, 0.3)
    stop_well(t, rig, client)


class Damage:
    """Changes a bit in one of thirty pieces. `stops`: number of changed pieces that contained a stop."""

    def __init__(self, chance):
        self.chance, self.stops = chance, 0

    def __call__(self, data):
        if self.chance.randrange(30) == 0:
            self.stops += b'"stop"' in data
            data = bytearray(data)
            data[self.chance.randrange(len(data))] ^= 1 << self.chance.randrange(8)
        return bytes(data)


class FirstAnswer:
    """Changes one byte in the first piece with a reply."""

    def __init__(self):
        self.done = False

    def __call__(self, data):
        at = -1 if self.done else data.find(b'"id":')
        if at < 0:
            return data
        self.done = True
        return data[:at] + b"!" + data[at + 1 :]


@scenario("a wire that damages one line in thirty to the board: no damaged command is obeyed, and a stop always arrives", 12)
def noisy(t):
    rig, client = begin(t)
    rig.cable.up = Damage(random.Random(3))
    stops = 0
    for _ in range(6):
        for _ in range(8):
            client.drive(150, 150)
            time.sleep(0.02)
        damaged = rig.cable.up.stops
        stops += 1 if client.request("stop")["ok"] else 0
        # The relay repeats a stop without a reply. Until the stop arrives, the lease may hold.
        late_us = min((rig.cable.up.stops - damaged) * STOP_AGAIN_US, LEASE_US)
        rig.timeline[-1] = rig.timeline[-1]._replace(within_us=late_us)
        rig.wait_status(client, lambda s: s.get("state") == "listening", 6)
        client.arm()
    rig.cable.up = None
    t.check(stops == 6, f"{stops} of 6 stops were answered")
    t.figure(f"{bytes(rig.cable.from_board).count(b'line_error')} line_errors")
    stop_well(t, rig, client)


@scenario("a wire that damages one line in thirty from the board: a missing reply is reported to the client, and a stop is repeated", 8)
def deaf(t):
    rig, client = begin(t)
    client.timeout = 5.0  # After 3 s the relay reports a missing reply.
    rig.cable.down = FirstAnswer()
    t.expect(client.request("status"), "internal")
    rig.cable.down = Damage(random.Random(4))
    for _ in range(4):
        for _ in range(8):
            client.drive(150, 150)
            time.sleep(0.02)
        t.check(client.request("stop")["ok"], "a stop is answered")
        stopped_us = now_us()
        rig.wait_status(client, lambda s: s.get("state") == "listening", 6)
        t.check(not rig.moving(stopped_us + 600_000), "it stops")
        client.arm()
    rig.cable.down = None
    t.silence(rig, client, 6, "listening")


@scenario("commands that the wire delays for longer than the lease move no wheel", 5)
def delayed(t):
    rig, client = begin_driving(t, 200, 200, 0.4)
    rig.cable.held = True
    time.sleep(0.03)  # The cable has delivered the bytes that it held.
    held_us = rig.note("ramp", within_us=LEASE_US)
    for number in range(60):
        client.send_raw(raw_drive(number, 200))
        time.sleep(0.01)
    t.check(not rig.moving(held_us + 500_000 + SEEN_US), "stopped by the lease meanwhile")
    released_us = now_us()
    rig.cable.held = False
    try:
        replies = read_replies(client, 60, 2.0)
        t.check(not any(r["ok"] for r in replies), f"{[r for r in replies if r['ok']][:2]}")
    except Closed:
        pass  # The relay reopens a port that accepts nothing for a second.
    time.sleep(0.4)
    t.rule(not rig.moving(released_us), "no command that waited in the wire moves a wheel")
    end_well(t, rig, await_service(t, rig))


@scenario("commands faster than the line: each gets a reply, the newest is sent, none waits", 5, native="a flood")
def too_fast(t):
    rig, client = begin(t)
    first_us = now_us()
    for number in range(400):
        client.send_raw(raw_drive(number, 100 + number % 50))
        if number % 10 == 9:
            time.sleep(0.005)
    replies = read_replies(client, 400)
    note_drives(rig, first_us, [r for r in replies if r["ok"]])
    t.check([r["id"] for r in replies] == list(range(400)), f"400 replies in order expected, {len(replies)} came")
    replaced = [r for r in replies if not r["ok"]]
    t.check(all(r["error"] == "stale_command" for r in replaced), f"{[r for r in replaced if r['error'] != 'stale_command'][:2]}")
    t.check(0 < len(replaced) < 400, f"{len(replaced)} of 400 were replaced")
    stop_well(t, rig, client)


@scenario("a flood of requests of one client costs another neither lease nor stop", 6, native="a flood")
def flood(t):
    rig, client = begin(t)
    flooder = rig.client()
    quit_now = threading.Event()

    def pour():
        try:
            while not quit_now.is_set():
                flooder.socket.send(b'{"cmd":"status"}\n' * 200)
        except OSError:
            pass

    def drain():
        try:
            while flooder.socket.recv(1 << 20):
                pass
        except OSError:
            pass

    threads = [threading.Thread(target=work, daemon=True) for work in (pour, drain)]
    for thread in threads:
        thread.start()
    t.drive_for(client, 200, 200, 1.5)
    begin_us = now_us()
    t.expect(rig.watcher().request("stop"))
    t.figure(f"stop in {(now_us() - begin_us) / 1000:.0f} ms during the flood")
    quit_now.set()
    flooder.socket.shutdown(socket.SHUT_RDWR)
    end_well(t, rig, rig.client())


@scenario("a client that reads nothing harms no other client, and learns about lost events", 6)
def slow(t):
    rig, client = begin(t)
    idle = rig.client()
    idle.request("watch", topics=["state", "force"], rate_hz=100)
    t.drive_for(client, 200, 200, 2.0)
    t.expect(client.request("stop"))
    t.check(idle.request("hello")["ok"], "it may continue after it reads again")
    end_well(t, rig, client)


@scenario("a watcher may only watch and stop; the ninth client is refused", 4)
def rights(t):
    rig, client = begin(t)
    watcher = rig.watcher()
    t.check(watcher.wait_event("hello")["rights"] == "watch", "rights")
    for cmd, fields in (
        ("arm", {}),
        ("drive", {"left_mm_s": 1, "right_mm_s": 1}),
        ("twist", {"v_mm_s": 1, "yaw_mrad_s": 0}),
        ("reset", {}),
        ("tare", {}),
        ("confirm", {"item": "wheel_radius"}),
    ):
        t.expect(watcher.request(cmd, **fields), "denied")
    t.drive_for(client, 200, 200, 0.4)
    t.expect(watcher.request("stop"))
    t.expect(client.drive(200, 200), "not_armed")
    t.silence(rig, client, 6, "listening")
    t.expect(watcher.request("estop", reason="a test"))
    t.check(client.request("status")["state"] == "latched", "latched")
    others = [rig.client() for _ in range(4)] + [rig.watcher() for _ in range(2)]
    for other in others:
        t.check(other.wait_event("hello"), "eight clients are accepted")
    for ninth in (rig.client(), rig.watcher()):
        reply = ninth.read_reply(1.0)
        t.check(reply and reply["error"] == "too_many_clients", f"the ninth: {reply}")
    others[0].close()
    t.check(await_service(t, rig), "a client that leaves frees its place")
    t.judge(rig)


def run(command):
    return subprocess.run(command, capture_output=True, text=True, timeout=20, check=False)


def run_tool(rig, *words):
    return run([rig.program("iwheelctl"), "--socket", rig.path("gateway.sock"), *words])


@scenario("one port has one relay, and a running gateway retains its socket", 4)
def alone(t):
    rig, _ = t.running()
    second = run(rig.relay_command("--socket", rig.path("second.sock"), "--watch-socket", "none"))
    t.check(second.returncode == 69 and str(rig.gateway.child.pid) in second.stderr and "two relays" in second.stderr, f"{second}")
    other = run(rig.relay_command("--port", "/dev/null"))
    t.check(other.returncode == 69 and "another program answers" in other.stderr, f"{other}")
    t.check(rig.client().request("hello")["ok"], "the first relay continues")
    t.judge(rig, moves=False)


def troubles():
    """(bytes of a device that is no board, words of the relay's reason)"""
    chance = random.Random(5)
    noise = bytes(chance.randrange(256) for _ in range(200))
    return (
        (b"", "nothing comes"),
        (noise, "baud"),
        (b"login: \r\nPassword: \r\n", "another protocol"),
        (framed(b'0 12 {"event":"link"}').replace(b"link", b"lunk"), "wrong CRC"),
        (b"0 12 {", "no whole line"),
    )


@contextlib.contextmanager
def talking(sock, sent):
    """A device that repeats these bytes while it is connected."""
    over = threading.Event()

    def talk():
        while sent and not over.wait(0.05):
            sock.sendall(sent)

    talker = threading.Thread(target=talk)
    talker.start()
    try:
        yield
    finally:
        over.set()
        talker.join()


def check_reported(t, rig, sent, words, seconds):
    """Checks that the log and a new client get this reason within that time."""
    t.check(rig.await_relay(words, seconds), f"{sent[:20]}: {words!r} expected, its output: {rig.gateway.text()[-400:]}")
    reply = rig.client().read_reply(1.0)
    t.check(reply and reply["error"] == "bus_down" and words in reply["message"], f"a client gets this reason: {reply}")


@scenario("the relay reports the fault of a line: nothing, noise, another protocol, another rate", 14)
def explained(t):
    rig = t.rig()
    for sent, words in troubles():
        theirs = rig.plug_device()
        with talking(theirs, sent):
            relay = rig.start_relay()
            check_reported(t, rig, sent, words, 8.0)
            relay.end()
        rig.cable.end()
        theirs.close()
    rig.cable = None


@scenario("the same relay reports another reason soon after the device changes", 18)
def explained_anew(t):
    rig = t.rig()
    theirs = rig.plug_device()
    rig.start_relay()
    for sent, words in troubles():
        with talking(theirs, sent):
            check_reported(t, rig, sent, words, 8.0)
    theirs.close()


@scenario("a board that restarted after a fault: the relay logs cause and address", 4)
def fault_of_the_board(t):
    rig = t.rig()
    theirs = rig.plug_device()
    rig.start_relay()
    link = {"event": "link", "boot": "0123456789abcdef", "version": "0.3.0", "fault_cause": 0x0C000100, "fault_pc": 0x08001234}
    with talking(theirs, framed(b"0 12 " + json.dumps(link).encode())):
        t.check(rig.await_relay("fault: cause 0x0C000100 at 0x08001234; report both", 4.0), rig.gateway.text()[-400:])
    theirs.close()


@scenario("ends cleanly by SIGTERM while a client drives", 3)
def terminated(t):
    rig, _ = begin_driving(t, 200, 200, 0.4)
    sent_before = len(rig.cable.from_relay)
    rig.note("gone")
    rig.gateway.signal(signal.SIGTERM)
    t.check(rig.gateway.wait(2) == 0, f"exit code: {rig.gateway.text()[-300:]}")
    time.sleep(0.05)
    last = bytes(rig.cable.from_relay[sent_before:])
    t.rule(b'"close","channel":' in last, f"the board is informed that the client has gone: {last}")
    t.check(not os.path.exists(rig.path("gateway.sock")), "its socket is removed")
    rig.start_relay()
    rig.await_relay("board on ")
    end_well(t, rig, await_service(t, rig))


@scenario("a stop that comes directly before SIGTERM reaches the board over a slow cable", 4)
def stop_before_the_end(t):
    rig, client = begin_driving(t, 200, 200, 0.4)
    rig.cable.held = True
    time.sleep(0.03)  # The cable has delivered the bytes that it held.
    client.send_raw(b'{"cmd":"estop","id":901}\n')
    rig.gateway.signal(signal.SIGTERM)
    time.sleep(0.1)
    rig.cable.held = False
    t.check(rig.gateway.wait(2) == 0, f"exit code: {rig.gateway.text()[-300:]}")
    t.check("no reply" not in rig.gateway.text(), rig.gateway.text()[-300:])
    rig.start_relay()
    rig.await_relay("board on ")
    client = await_service(t, rig)
    state = client.request("status")["state"]
    t.rule(state == "latched", f"the board has executed the e-stop: {state}")
    t.reset(client)
    t.silence(rig, client, 6)


@scenario("iwheelctl, unchanged, through the relay", 5)
def tool(t):
    rig, _ = t.running()
    drove = run_tool(rig, "drive", "200", "200", "--for", "800ms")
    t.check(drove.returncode == 0 and "drove 200/200" in drove.stdout, f"{drove}")
    why = run_tool(rig, "--json", "why")
    t.check(json.loads(why.stdout)["cause"] == "client_stop", f"{why}")
