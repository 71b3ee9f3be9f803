# SPDX-License-Identifier: MIT
"""Instructions of the bridges per second, next to a gateway at 617 frames/s (callgrind).

iwheel-web has no client and iwheel-ros2 no reader; iwheel-mqtt sends every state to a broker. The figures vary by a few per cent with the number of lines
that arrive together, so they are compared with limits.
"""

import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path

import loop
from free_domain import free_domain
from free_port import free_port

START_S = 30
SETTLE_S = 7.0  # iwheel-web sends at its full rate for 5 s after it has connected.
# Instructions per second: above the measured figures (46 000 to 151 000, 324 000 to 556 000, 1 730 000 to 3 710 000), because the client checks a state completely
# if more than its integers has changed, which happens more or less often.
LIMITS = {"iwheel-web, no client": 195000, "iwheel-mqtt, a state every 100 ms": 800000, "iwheel-ros2, odometry at 50 Hz": 5000000}
PROGRAMS = {"iwheel-web": "web", "iwheel-mqtt": "mqtt", "iwheel-ros2": "ros2"}


def broker(folder):
    """Starts a mosquitto and returns its port."""
    port = free_port()
    (folder / "mosquitto.conf").write_text(f"listener {port} 127.0.0.1\nallow_anonymous true\n")
    return port, subprocess.Popen(["mosquitto", "-c", folder / "mosquitto.conf"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def settings(build, name, pair, folder, port):
    gateway = f"[gateway]\nsocket = {pair.northbound}\n"
    if name == "iwheel-web":
        return gateway + f"[web]\nport = {free_port()}\ntoken_file = {folder}/token\npage = {build}/app/bridge/web/page\n"
    if name == "iwheel-mqtt":
        (folder / "spool").mkdir(mode=0o700)
        return gateway + f"[machine]\nid = bench\n[broker]\nport = {port}\n[state]\nevery_ms = 100\n[spool]\ndirectory = {folder}/spool\n"
    return gateway + f"[ros]\ndomain = {free_domain()}\nnetwork = loopback\n"


def await_words(path, words):
    end = time.monotonic() + START_S
    while words not in path.read_text(errors="replace"):
        if time.monotonic() > end:
            raise RuntimeError(f"not started: {path.read_text(errors='replace')[-500:]}")
        time.sleep(0.1)


def count(build, name, pair, folder):
    """Instructions of the bridge per second."""
    folder.mkdir()
    port, mosquitto = broker(folder) if name == "iwheel-mqtt" else (0, None)
    (folder / "bridge.conf").write_text(settings(build, name, pair, folder, port))
    out = folder / "out"
    under = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={folder}/callgrind.out"]
    with out.open("wb") as log:
        bridge = subprocess.Popen([*under, build / "app/bridge" / PROGRAMS[name] / name, "-c", folder / "bridge.conf"], stdout=log, stderr=log)
    try:
        await_words(out, "connected to ")
        time.sleep(SETTLE_S)
        return loop.instructions(bridge.pid, folder)
    finally:
        for process in (bridge, mosquitto):
            if process:
                process.send_signal(signal.SIGTERM)
                process.wait(20)


def rows(build, pair_type):
    """(bridge, instructions per second, or None if a program is missing)"""
    with tempfile.TemporaryDirectory(prefix="iwheel-bench-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        (folder / "pair").mkdir()
        pair = pair_type(build, folder / "pair")
        try:
            found = []
            for what, limit in LIMITS.items():
                program = what.split(",", maxsplit=1)[0]
                there = (Path(build) / "app/bridge" / PROGRAMS[program] / program).exists() and (program != "iwheel-mqtt" or shutil.which("mosquitto"))
                figure = count(Path(build), program, pair, folder / program) if there else None
                if figure is not None and figure > limit:  # A connection that was lost once costs more.
                    figure = min(figure, count(Path(build), program, pair, folder / f"{program}-again"))
                found.append((what, figure))
            return found
        finally:
            pair.end()
