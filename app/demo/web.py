#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The web page of two simulated wheels, to watch and to drive. See ./demo --help."""

import argparse
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent.parent / "test/system"))

from ends import end_with_signals, other_terminal, require_free
from harness import Process, Rig, find_program

# As in the other demonstrations: wide limits for a busy machine.
CONFIG = {"limits": {"wheel_silent_ms": 200, "echo_ms": 200}, "drive": {"lease_ms": 500, "max_speed_mm_s": 500}}


def bridge(rig, port, lan):
    """Starts the bridge, allowed to drive simulated wheels, and prints the page's address; with `lan` for phones of this network, as a QR code too."""
    settings = rig.path("web.conf")
    page = Path(rig.build, "app/bridge/web/page").resolve()
    Path(settings).write_text(
        f"[gateway]\nsocket = {rig.path('gateway.sock')}\n[web]\nport = {port}\ntoken_file = {rig.path('token')}\npage = {page}\n"
        "[drive]\nenabled = yes\nallow_reset = yes\n",
        encoding="utf-8",
    )
    program = find_program(rig.build, "iwheel-web")
    print("\nThe page of two simulated wheels, which can drive them:\n", flush=True)
    process = Process([program, "-c", settings, *(["--lan"] if lan else [])], rig.path("web.out"), **({"stdout": None} if lan else {}))
    rig.processes.append(process)
    time.sleep(0.5)
    if process.child.poll() is not None:
        sys.exit(f"demo: iwheel-web ended: {process.text()}")
    if not lan:
        subprocess.run([program, "-c", settings, "--url"], check=True)


def main():
    parser = argparse.ArgumentParser(prog="./demo --web")
    parser.add_argument("--build", required=True)
    parser.add_argument("--port", type=int, default=8470)
    parser.add_argument("--lan", action="store_true")
    options = parser.parse_args()
    require_free([options.port], "--web")
    end_with_signals(interrupted=0)
    rig = Rig(options.build, CONFIG)
    try:
        rig.start_gateway()
        bridge(rig, options.port, options.lan)
        sim = os.path.relpath(find_program(rig.build, "iwheel-sim"))
        phone = (
            "The browser warns once, because this machine has created its own certificate."
            if options.lan
            else f"From a phone: ./demo --web --lan, or  ssh -L {options.port}:127.0.0.1:{options.port} THIS-MACHINE"
        )
        print(
            f"""
{phone}
In another terminal, in this folder:

{other_terminal(rig)}
Faults:                          {sim} --control {rig.path("control")} estop press
                                 {sim} --control {rig.path("control")} help

Ctrl-C ends it.""",
            flush=True,
        )
        signal.pause()
    finally:
        rig.close()


if __name__ == "__main__":
    main()
