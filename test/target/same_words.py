#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Asks the Linux gateway and the image `gateway` on the emulated CPU the same things, and compares what they answer, byte by byte.

usage: same_words.py MODEL_LIBRARY IMAGE_ELF GATEWAY SIMULATOR

Numbers that a run measures are compared as numbers only; what a microcontroller has not must be null there. Needs the Python package
unicorn. The last line is "N passed, N failed, N skipped".
"""
import json
import re
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.dont_write_bytecode = True

from emulate import Rig
from emulator.can import Controller, load_model
from emulator.chip import MS
from emulator.machine import Machine
from host import Host, compact

CONFIGURATION = "[wheels]\nsetpoint_type = 1\ncurrent_role = limit\n"
# (milliseconds to wait before, request)
STORY = (
    (0, {"cmd": "hello"}), (0, {"cmd": "nonsense"}), (0, {"cmd": "arm", "speed": 1}), (0, {"cmd": "drive", "left_mm_s": 100}),
    (0, {"cmd": "drive", "left_mm_s": 0, "right_mm_s": 0}), (0, {"cmd": "status"}), (0, {"cmd": "why"}), (0, {"cmd": "reset"}),
    (0, {"cmd": "watch", "topics": ["stop", "lease", "estop", "bus"], "rate_hz": 5}), (0, {"cmd": "watch", "topics": ["weather"]}),
    (3000, {"cmd": "tare", "side": "up"}), (0, {"cmd": "tare", "side": "left"}), (0, {"cmd": "arm", "name": "the same"}),
    (0, {"cmd": "drive", "left_mm_s": 100, "right_mm_s": 50}), (20, {"cmd": "drive", "left_mm_s": 1500, "right_mm_s": 750}),
    (20, {"cmd": "drive", "left_mm_s": 40000, "right_mm_s": 0}), (20, {"cmd": "drive", "left_mm_s": 1, "right_mm_s": 1, "left_mA": 5}),
    (20, {"cmd": "twist", "v_mm_s": 50, "yaw_mrad_s": 10}), (20, {"cmd": "status"}), (0, {"cmd": "stop"}), (700, {"cmd": "drive", "left_mm_s": 1, "right_mm_s": 1}),
    (600, {"cmd": "why"}), (1500, {"cmd": "estop", "reason": "to compare"}), (0, {"cmd": "arm"}), (300, {"cmd": "why"}), (0, {"cmd": "reset"}),
    (1500, {"cmd": "reset"}), (0, {"cmd": "status"}),
)
# What only one of them has: the disk, the process, the wall clock, the ledger's sentences, the controller's own load; and what the wheels of
# the simulator and those of the emulator differ in: the moment at which they stand, and where their zero comes from.
ABSENT = {"wall_us", "pid", "directory", "recording", "recording_error", "frames_before", "frames_after", "memory", "gaps", "load_permille", "lost_frames",
          "ledger", "bitrate", "sample_point_permille", "warnings", "timing", "name", "line", "simulated",
          "at_rest", "heard", "valid", "unit_evidence", "force_validity", "offset_provenance", "offset_origin", "before_provenance", "offset_window", "offset_contaminated"}
# A board has no random source, so that its reply to arm has no key.
DAEMON_ONLY = {"key"}
# A number, or null where the wheels have not said it yet.
MEASURED_OR_NULL = {"x_mm", "y_mm", "z_mm", "psi_mrad", "age_ms", "wheel_offset_mN", "speed_rpm", "speed_mm_s", "acceleration_raw", "offset_age_ms", "force_age_ms",
                    "force_net_mN", "force_offset_mN", "offset_samples", "offset_deviation_mN", "offset_drift_mN"}
MEASURED = re.compile(r"-?\d+")


def masked(text, bus, estop):
    """A text without the numbers of the run, the process and the names of bus and pin."""
    text = text.replace(bus, "BUS").replace(estop, "PIN")
    text = re.sub(r'user \d+ \(process \d+\)|"[^"]*" \(client \d+\)(?=[;.])', "WHO", re.sub(r", pid \d+", "", text))
    return MEASURED.sub("#", text)


def shape(value, names, key=None):
    """What is compared: keys in their order, words, and that a number is one."""
    if key in ABSENT:
        return "ABSENT"
    if isinstance(value, dict):
        return {name: shape(part, names, name) for name, part in value.items() if name not in DAEMON_ONLY}
    if isinstance(value, list):
        return [shape(part, names) for part in value]
    if isinstance(value, str):
        return masked(value, *names)
    return "#" if value is None and key in MEASURED_OR_NULL or isinstance(value, int) and not isinstance(value, bool) else value


def ask_linux(gateway, simulator, folder):
    bus, button, sock = f"unix:{folder}/bus", f"unix:{folder}/estop", f"{folder}/gateway.sock"
    Path(folder, "gateway.conf").write_text(CONFIGURATION + f"[record]\ndirectory = {folder}\n[northbound]\nwatch_socket = none\ngroup = none\n")
    with subprocess.Popen([simulator, "--can", bus, "--estop", button], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as sim, \
            subprocess.Popen([gateway, "-c", f"{folder}/gateway.conf", "--can", bus, "--socket", sock, "--estop", button], stdout=subprocess.DEVNULL,
                             stderr=subprocess.DEVNULL) as daemon:
        try:
            return list(converse(sock)), (bus, button)
        finally:
            daemon.terminate()
            daemon.wait()
            sim.terminate()


def converse(path):
    """Waiting here is what the story says: the daemon lives in real time."""
    for _ in range(200):
        try:
            line = socket.socket(socket.AF_UNIX)
            line.connect(path)
            break
        except OSError:
            time.sleep(0.05)
    stream = line.makefile("rwb")
    time.sleep(1)
    for number, (wait_ms, request) in enumerate(STORY):
        time.sleep(wait_ms / 1000)
        stream.write(compact({**request, "id": number}) + b"\n")
        stream.flush()
        reply = {}
        while reply.get("id") != number:
            reply = json.loads(stream.readline())
        yield reply
    line.close()


def ask_image(elf):
    rig = Rig("stm32f103", elf)
    host = Host(rig)
    host.begin()
    rig.run(400 * MS)
    replies = []
    for number, (wait_ms, request) in enumerate(STORY):
        rig.run(wait_ms * MS)
        body = {**request, "id": number}
        host.say(1, host.quoted(1, body) if request["cmd"] in ("drive", "twist") else body)
        replies.append(host.wait(lambda line, wanted=number: line.message.get("id") == wanted and line.channel == 1).message)
    return replies, ("can", "PB0")


def main(arguments):
    if len(arguments) != 5:
        sys.exit(__doc__)
    Machine.library = Controller.library = load_model(Path(arguments[1]).resolve())
    with tempfile.TemporaryDirectory() as folder:
        theirs, names = ask_linux(arguments[3], arguments[4], folder)
    ours, our_names = ask_image(arguments[2])
    failed = 0
    for (_, request), linux, image in zip(STORY, theirs, ours):
        one, other = (json.dumps(shape(reply, names_of)) for reply, names_of in ((linux, names), (image, our_names)))
        failed += one != other
        print(f"{'ok  ' if one == other else 'FAIL'} same words: {compact(request).decode()}" + ("" if one == other else f"\n  linux {one}\n  image {other}"))
    print(f"{len(STORY) - failed} passed, {failed} failed, 0 skipped")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
