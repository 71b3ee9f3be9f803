#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Three simulated machines at one broker, and the console with their states, stops and recordings. See ./demo --help."""

import argparse
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "test/system"))

from ends import end_with_signals, other_terminal, require_free
from harness import Process, Rig, find_program

# As in the other demonstrations: wide limits for a busy machine.
CONFIG = {"limits": {"wheel_silent_ms": 200, "echo_ms": 200}, "drive": {"lease_ms": 500, "max_speed_mm_s": 500}}


def write(path, text):
    Path(path).write_text(text, encoding="utf-8")
    return path


def listens(process, name, port):
    for _ in range(100):
        with socket.socket() as one:
            if one.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.05)
    sys.exit(f"demo: {name} does not listen: {process.text()}")


def broker(rig, port):
    """Starts a nats-server, which stores a history, on this port and the next one; without it a mosquitto. Returns more configuration for the console."""
    server = shutil.which("nats-server") or "/usr/sbin/nats-server"
    if os.path.exists(server):
        config = write(
            rig.path("nats.conf"),
            f'server_name: demo\nlisten: 127.0.0.1:{port + 1}\njetstream {{ store_dir: "{rig.path("nats")}" }}\nmqtt {{ listen: 127.0.0.1:{port} }}\n',
        )
        process = Process([server, "-c", config], rig.path("nats.out"))
        rig.processes.append(process)
        listens(process, "nats-server", port)
        subprocess.run([ROOT / "share/fleet/stream", f"127.0.0.1:{port + 1}", "-", "create", "--replicas", "1"], check=True, stdout=subprocess.DEVNULL)
        return f"stream_port = {port + 1}\n"
    user = "" if os.geteuid() else "user root\n"
    config = write(rig.path("mosquitto.conf"), f"listener {port} 127.0.0.1\nallow_anonymous true\n{user}")
    process = Process([shutil.which("mosquitto") or "/usr/sbin/mosquitto", "-c", config], rig.path("mosquitto.out"))
    rig.processes.append(process)
    listens(process, "mosquitto", port)
    return ""


def bridge(rig, name, port):
    os.mkdir(rig.path("spool"), 0o700)
    config = write(
        rig.path("mqtt.conf"),
        f"[gateway]\nsocket = {rig.path('gateway.sock')}\n[machine]\nid = {name}\n[broker]\nport = {port}\n"
        f"[state]\nevery_ms = 1000\n[spool]\ndirectory = {rig.path('spool')}\n",
    )
    rig.processes.append(Process([find_program(rig.build, "iwheel-mqtt"), "-c", config], rig.path("mqtt.out")))


def report(rigs, console, storage, iwheelctl):
    """Shows the console while one machine is stopped and the gateway of another one is killed, then the history and the recording. Returns an exit code."""
    with subprocess.Popen([*console, "--for", "6"], stdout=subprocess.PIPE, text=True) as watching:
        time.sleep(3)
        rigs[0].sim.ask("estop press")
        rigs[-1].gateway.signal(signal.SIGKILL)
        text = watching.communicate()[0]
    print(text)
    reported = f"{len(rigs)} machines, {len(rigs) - 1} online" in text and "estop_line" in text
    print("walker-1 was stopped by its button, the last one's gateway was killed" + ("" if reported else ": NOT REPORTED"))
    frames = rigs[0].path("fetched.log")
    for words in (
        [*console, "history", "--last", "5min"] if storage else None,
        [*console, "recording", "walker-1", "--output", frames],
        [iwheelctl, "why", frames, "--frames", "1"],
    ):
        if words:
            print(f"\n$ {' '.join([Path(words[0]).name, *words[1:]])}", flush=True)
            done = subprocess.run(words, check=False, capture_output=True, text=True)
            print(done.stdout + done.stderr, end="", flush=True)
            reported = reported and done.returncode == 0 and ("walker-1" in done.stdout or words[0] == iwheelctl)
    return 0 if reported else 1


def main():
    parser = argparse.ArgumentParser(prog="./demo --fleet")
    parser.add_argument("--build", required=True)
    parser.add_argument("--machines", type=int, default=3)
    parser.add_argument("--port", type=int, default=18830)
    parser.add_argument("--plain", action="store_true")
    options = parser.parse_args()
    require_free([options.port, options.port + 1], "--fleet")
    end_with_signals(interrupted=0)
    rigs, storage = [], ""
    try:
        for number in range(options.machines):
            rigs.append(Rig(options.build, CONFIG))
            if number == 0:
                storage = broker(rigs[0], options.port)
            rigs[-1].start_gateway()
            bridge(rigs[-1], f"walker-{number + 1}", options.port)
        config = write(rigs[0].path("fleet.conf"), f"[broker]\nport = {options.port}\n{storage}")
        console = [find_program(options.build, "iwheel-fleet"), "-c", config]
        if options.plain or not sys.stdout.isatty():
            return report(rigs, console, storage, find_program(options.build, "iwheelctl"))
        again = " ".join([os.path.relpath(console[0]), *console[1:]])
        sim = os.path.relpath(find_program(options.build, "iwheel-sim"))
        print(
            f"{options.machines} machines at the broker on port {options.port}. In another terminal, in this folder:\n\n"
            f"{other_terminal(rigs[0])}\n    {sim} --control {rigs[0].path('control')} estop press\n    {again} recording walker-1\n"
            + (f"    {again} history --last 5min\n" if storage else ""),
            flush=True,
        )
        time.sleep(5)
        return subprocess.run(console, check=False).returncode
    finally:
        for rig in reversed(rigs):
            rig.close()


if __name__ == "__main__":
    sys.exit(main())
