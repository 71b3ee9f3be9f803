#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The web page of two simulated wheels, to look at and to drive. See ./demo --help."""

import argparse
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent.parent / "test/system"))

from harness import Process, Rig, find_program

# As in the other demonstration: for any machine, however busy.
CONFIG = {"limits": {"wheel_silent_ms": 200, "echo_ms": 200}, "drive": {"lease_ms": 500, "max_speed_mm_s": 500}}


def bridge(rig, port):
    """The bridge, allowed to drive, and the page's address."""
    settings = rig.path("web.conf")
    page = Path(rig.build, "app/bridge/web/page").resolve()
    Path(settings).write_text(
        f"[gateway]\nsocket = {rig.path('gateway.sock')}\n[web]\nport = {port}\ntoken_file = {rig.path('token')}\npage = {page}\n"
        "[drive]\nenabled = yes\nallow_reset = yes\n",
        encoding="utf-8",
    )
    program = find_program(rig.build, "iwheel-web")
    process = Process([program, "-c", settings], rig.path("web.out"))
    rig.processes.append(process)
    time.sleep(0.5)
    if process.child.poll() is not None:
        sys.exit(f"demo: iwheel-web ended: {process.text()}")
    return subprocess.run([program, "-c", settings, "--url"], check=True, capture_output=True, text=True).stdout.strip()


def main():
    parser = argparse.ArgumentParser(prog="./demo --web")
    parser.add_argument("--build", required=True)
    parser.add_argument("--port", type=int, default=8470)
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    rig = Rig(options.build, CONFIG)
    try:
        rig.start_gateway()
        url = bridge(rig, options.port)
        sim = os.path.relpath(find_program(rig.build, "iwheel-sim"))
        print(
            f"""
The page of two simulated wheels, which may be driven from it:

    {url}

From a phone, forward the port:  ssh -L {options.port}:127.0.0.1:{options.port} THIS-MACHINE
Faults, in another terminal:     {sim} --control {rig.path("control")} estop press
                                 {sim} --control {rig.path("control")} help

Ctrl-C ends it.""",
            flush=True,
        )
        signal.pause()
    except KeyboardInterrupt:
        print()
    finally:
        rig.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
