# SPDX-License-Identifier: MIT
"""The rig's own tests: the parts that the other tests use work as these tests assume, and faults of the rig are detected."""

import errno
import os
import socket
import subprocess
import time
from pathlib import Path

import netdev
from bus import ERROR, EXTENDED, FRAME, REMOTE, now_us
from can_bus import CAN_RAW_ERR_FILTER, CanBus, open_raw
from catalogue import kernel_test
from fake_slcan import FakeSlcan
from gpio_sim import Edges, GpioChip
from harness import find_program
from kernel_rig import virtual

EVERY_BOOT = "plumbing plumbing-echo plumbing-realtime"
FRAME_512 = FRAME.pack(512, 3, 0, 0, b"\1\2\3" + bytes(5))


def fresh_bus(name):
    """A recorder on a new vcan; one that a failed attempt left is removed."""
    netdev.remove_all([name])
    netdev.add_vcan(name)
    return CanBus(name, exact=virtual())


def seen(bus, count, seconds=2.0):
    """Waits until that many frames were recorded."""
    end = time.monotonic() + seconds
    while len(bus.frames) < count and time.monotonic() < end:
        time.sleep(0.001)
    return bus.frames


@kernel_test("vcan: the recorder receives every kind of frame, marks its own, and the time is right", EVERY_BOOT, 0)
def plumbing_vcan(t):
    bus = fresh_bus("vcan9")
    with open_raw("vcan9") as other:
        time.sleep(0.01)
        sent_us = now_us()
        other.send(FRAME_512)
        other.send(FRAME.pack(257 | EXTENDED, 1, 0, 0, bytes(8)))
        other.send(FRAME.pack(256 | REMOTE, 4, 0, 0, bytes(8)))
        bus.send(298, b"\1\0\0\0\0")
        frames = seen(bus, 4)
    t.check([f.id for f in frames] == [512, 257 | EXTENDED, 256 | REMOTE, 298], f"ids {[hex(f.id) for f in frames]}")
    t.check([f.own for f in frames] == [False, False, False, True], "only what it sent itself is its own")
    t.check(frames[0].data == b"\1\2\3", f"data {frames[0].data}")
    t.check(abs(frames[0].t_us - sent_us) < 2000, f"stamp off by {frames[0].t_us - sent_us} us", True)
    bus.close()
    netdev.delete("vcan9")


@kernel_test("netem delays, pfifo limit 0 answers ENOBUFS, a link that is down ENETDOWN", EVERY_BOOT, 0)
def plumbing_discipline(t):
    bus = fresh_bus("vcan9")
    echo = bool(netdev.flags("vcan9") & netdev.IFF_ECHO)
    t.check(echo == ("vcan.echo=1" in Path("/proc/cmdline").read_text(encoding="ascii")), f"IFF_ECHO is {echo}")
    with open_raw("vcan9") as other:
        netdev.discipline("vcan9", "netem", "delay", "200ms")
        sent_us = now_us()
        other.send(FRAME_512)
        frames = seen(bus, 1)
        delay_ms = (frames[0].t_us - sent_us) / 1000
        t.check(199 < delay_ms < 230 if echo else delay_ms < 5, f"the echo came after {delay_ms:.1f} ms")
        netdev.discipline("vcan9", "pfifo", "limit", "0")
        t.check(error_of(other) == errno.ENOBUFS, "pfifo limit 0 refuses")
        netdev.discipline("vcan9")
        t.check(error_of(other) is None, "the default accepts frames again")
        netdev.down("vcan9")
        t.check(error_of(other) == errno.ENETDOWN, "the interface that is down is reported")
        netdev.up("vcan9")
    t.figure(f"echo after {delay_ms:.1f} ms of 200 ms")
    bus.close()
    netdev.delete("vcan9")


def error_of(sock):
    """The error number of sending; one pending error of the socket is read first."""
    try:
        sock.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        sock.send(FRAME_512)
        return None
    except OSError as error:
        return error.errno


@kernel_test("gpio-sim: a line with edges; a chip that disappears while its line is read", EVERY_BOOT, 0)
def plumbing_gpio(t):
    chip = GpioChip(f"iwheel_test{os.getpid()}", "TEST")
    chip.pull(False)
    edges = Edges(chip.chip, chip.OFFSET)
    pulled_us = now_us()
    chip.pull(True)
    first = edges.next(1.0)
    chip.pull(False)
    second = edges.next(1.0)
    t.check(first and second and first[1] and not second[1], f"both edges of a long pulse: {first}, {second}")
    chip.pull(True)
    chip.pull(False)
    t.check(edges.next(1.0), "at least one edge of a short pulse")
    latency_us = first[0] - pulled_us if first else 0
    t.check(-100 < latency_us < 25_000, f"the kernel stamped the edge {latency_us} us after the pull", True)
    t.figure(f"edge stamped after {latency_us / 1000:.2f} ms")
    chip.vanish()
    time.sleep(0.1)
    chip.appear()
    chip.pull(True)
    t.check(chip.level(), "it returns with the level of the pull")
    edges.close()
    chip.remove()
    t.check(not os.path.exists(chip.folder), "removed")


@kernel_test("the simulator on an interface that comes up later: its wheels are online immediately", EVERY_BOOT, 0)
def plumbing_late_interface(t):
    bus = fresh_bus("vcan9")
    netdev.down("vcan9")
    time.sleep(1.0)  # Since the start of the kernel: the simulator must not count this as a pause of its own.
    command = [find_program(t.plan["build"], "iwheel-sim"), "--can", "vcan9", "--estop", "none"]
    simulator = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    time.sleep(0.7)
    t.check(not bus.frames, "nothing while it is down")
    netdev.up("vcan9")
    t.check(len(seen(bus, 100)) >= 100, f"{len(bus.frames)} frames in two seconds")
    simulator.terminate()
    said = simulator.communicate()[0]
    t.check("the interface is up" in said and "was stopped for" not in said, f"its output is {said}")
    bus.close()
    netdev.delete("vcan9")


def receive_errors(interface):
    sock = open_raw(interface)
    sock.setsockopt(socket.SOL_CAN_RAW, CAN_RAW_ERR_FILTER, 0x1FFFFFFF)
    sock.settimeout(1.0)
    return sock


@kernel_test("fake slcan adapter: frames both ways, states, stall, ENOBUFS, unplugging", EVERY_BOOT, 0)
def plumbing_slcan(t):
    adapter = FakeSlcan()
    until = time.monotonic() + 1.0
    while not adapter.open and time.monotonic() < until:  # the adapter runs in its own thread
        time.sleep(0.01)
    t.check(b"S8" in adapter.commands and adapter.open, f"set up with {adapter.commands}")
    with receive_errors(adapter.interface) as sock:
        sock.send(FRAME_512)
        sock.send(FRAME.pack(0x1234567 | EXTENDED, 8, 0, 0, b"abcdefgh"))
        time.sleep(0.05)
        t.check(adapter.received == [(512, 3, b"\1\2\3"), (0x1234567 | EXTENDED, 8, b"abcdefgh")], f"received {adapter.received}")
        for line, wanted in ((b"t1004000F0000\r", (256, 4)), (b"r1004\r", (256 | REMOTE, 4)), (b"T000001001FF\r", (256 | EXTENDED, 1))):
            adapter.write(line)
            t.check(FRAME.unpack(sock.recv(16))[:2] == wanted, f"{line} arrives")
        for state, at, bits in (("passive", 1, 0x30), ("active", 1, 0x40), ("bus_off", None, None)):
            adapter.report(state)
            can_id, _, _, _, data = FRAME.unpack(sock.recv(16))
            good = can_id & ERROR and (can_id & 0x40 if at is None else data[at] & bits)
            t.check(good, f"{state}: error frame {can_id:08X} {data.hex()}")
        t.check("BUS-OFF" in netdev.command("ip", "-d", "link", "show", adapter.interface), "the kernel reports bus-off")
        netdev.down(adapter.interface)
        netdev.up(adapter.interface)
        stall(t, adapter, sock)
    adapter.unplug()
    time.sleep(0.1)
    t.check(not adapter.is_there(), "unplugged, the interface is gone")
    adapter.plug()
    adapter.link_up()
    t.check(adapter.is_there(), "plugged in again, it is back")
    adapter.end()


def stall(t, adapter, sock):
    """The number of frames that a stalled adapter accepts before the kernel reports it; they come out stale."""
    sock.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
    before = len(adapter.received)
    adapter.stall(True)
    time.sleep(0.05)
    accepted = 0
    for _ in range(2000):
        if error_of(sock) is not None:
            break
        accepted += 1
        time.sleep(0.001)
    t.check(0 < accepted < 2000, f"{accepted} frames accepted by a stalled adapter")
    adapter.stall(False)
    time.sleep(0.5)
    t.check(len(adapter.received) - before == accepted, f"{len(adapter.received) - before} of {accepted} come out afterwards")
    t.figure(f"a stalled adapter accepts {accepted} frames")
