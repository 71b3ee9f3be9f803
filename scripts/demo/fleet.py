#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Three simulated machines at one broker, and the console that shows them. See ./demo --help."""

import argparse
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent.parent / "test/system"))

from harness import Process, Rig, find_program  # noqa: E402

# As in the other demonstration: for any machine, however busy.
CONFIG = {"limits": {"wheel_silent_ms": 200, "echo_ms": 200}, "drive": {"lease_ms": 500, "max_speed_mm_s": 500}}


def write(path, text):
    Path(path).write_text(text, encoding="utf-8")
    return path


def broker(rig, port):
    user = "" if os.geteuid() else "user root\n"
    config = write(rig.path("mosquitto.conf"), f"listener {port} 127.0.0.1\nallow_anonymous true\n{user}")
    process = Process([shutil.which("mosquitto") or "/usr/sbin/mosquitto", "-c", config], rig.path("mosquitto.out"))
    rig.processes.append(process)
    for _ in range(100):
        with socket.socket() as one:
            if one.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.05)
    sys.exit(f"demo: mosquitto does not listen: {process.text()}")


def bridge(rig, name, port):
    os.mkdir(rig.path("spool"), 0o700)
    config = write(rig.path("mqtt.conf"), f"[gateway]\nsocket = {rig.path('gateway.sock')}\n[machine]\nid = {name}\n[broker]\nport = {port}\n"
                                          f"[state]\nevery_ms = 1000\n[spool]\ndirectory = {rig.path('spool')}\n")
    rig.processes.append(Process([find_program(rig.build, "iwheel-mqtt"), "-c", config], rig.path("mqtt.out")))


def main():
    parser = argparse.ArgumentParser(prog="./demo --fleet")
    parser.add_argument("--build", required=True)
    parser.add_argument("--machines", type=int, default=3)
    parser.add_argument("--port", type=int, default=18830)
    parser.add_argument("--plain", action="store_true")
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    rigs = []
    try:
        for number in range(options.machines):
            rigs.append(Rig(options.build, CONFIG))
            if number == 0:
                broker(rigs[0], options.port)
            rigs[-1].start_gateway()
            bridge(rigs[-1], f"walker-{number + 1}", options.port)
        config = write(rigs[0].path("fleet.conf"), f"[broker]\nport = {options.port}\n")
        console = [find_program(options.build, "iwheel-fleet"), "-c", config]
        if options.plain or not sys.stdout.isatty():
            watching = subprocess.Popen([*console, "--for", "6"], stdout=subprocess.PIPE, text=True)
            time.sleep(3)
            rigs[0].sim.ask("estop press")
            rigs[-1].gateway.signal(signal.SIGKILL)
            text = watching.communicate()[0]
            print(text)
            told = f"{options.machines} machines, {options.machines - 1} online" in text and "estop_line" in text
            print("walker-1 was stopped by its button, the last one's gateway was killed" + ("" if told else ": NOT TOLD"))
            return 0 if told else 1
        sim = os.path.relpath(find_program(options.build, "iwheel-sim"))
        print(f"{options.machines} machines at the broker on port {options.port}. In another terminal:\n\n"
              f"    {sim} --control {rigs[0].path('control')} estop press\n    mosquitto_sub -p {options.port} -v -t 'iwheel/#'\n", flush=True)
        time.sleep(5)
        return subprocess.run(console, check=False).returncode
    except KeyboardInterrupt:
        print()
        return 0
    finally:
        for rig in reversed(rigs):
            rig.close()


if __name__ == "__main__":
    sys.exit(main())
