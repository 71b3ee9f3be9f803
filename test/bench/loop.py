# SPDX-License-Identifier: MIT
"""What the gateway's loop costs in the states that users are in: instructions (callgrind) and system calls (strace) for each frame received.

Over the local bus at the nominal 617 frames/s, as a process. Frames come when the simulator is woken, so that the figures move by a few per cent:
they are held against limits. A machine under load makes them smaller, never larger.
"""
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

FRAMES_S = 617
WATCH_S = 4.0
COMMANDS_S = 20  # Commands of a client that drives, in a second.
SETTLE_S = 0.7


def quiet(_client, _quit_it):
    """A client that only is there."""


def watch(client, _quit_it):
    client.ask(cmd="watch", topics=["state"], rate_hz=50)
    threading.Thread(target=swallow, args=(client,), daemon=True).start()


def swallow(client):
    try:
        while client.socket.recv(1 << 16):
            pass
    except OSError:
        pass


def drive(client, quit_it):
    """Armed, and driving until the end."""
    for _ in range(100):
        if client.ask(cmd="arm", name="bench")["ok"]:
            break
        time.sleep(0.1)
    drive_once(client)
    threading.Thread(target=keep_driving, args=(client, quit_it), daemon=True).start()


def drive_once(client):
    reply = client.ask(cmd="drive", left_mm_s=100, right_mm_s=100)
    if not reply["ok"]:
        raise RuntimeError(f"the gateway does not drive: {reply}")


def keep_driving(client, quit_it):
    while not quit_it.wait(1 / COMMANDS_S):
        drive_once(client)


# What is done in a state, and by how many clients: the dearest first.
STATES = {"driving": (drive, 1), "one client watching at 50 Hz": (watch, 1), "a client": (quiet, 1), "nobody": (None, 0)}
LIMITS = {"one client watching at 50 Hz": (7000, 2.5), "a client": (3000, 2.5), "nobody": (1000, 2.5), "driving": (None, 2.5)}


def in_state(pair, client_type, state, count):
    """`count()` while the gateway is in that state."""
    begin, clients = STATES[state]
    quit_it = threading.Event()
    connected = [client_type(pair.northbound) for _ in range(clients)]
    try:
        for client in connected:
            begin(client, quit_it)
        time.sleep(SETTLE_S)
        return count()
    finally:
        quit_it.set()
        time.sleep(2 / COMMANDS_S)
        for client in connected:
            client.socket.shutdown(2)
            client.close()
        time.sleep(SETTLE_S)


def calls(pid):
    """System calls in a second, by name. A clock is none: the kernel maps it."""
    trace = subprocess.Popen(["strace", "-f", "-c", "-q", "-p", str(pid)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    time.sleep(WATCH_S)
    trace.send_signal(signal.SIGINT)
    found = re.findall(r"^\s*[\d.]+\s+[\d.]+\s+\d+\s+(\d+)\s+(?:\d+\s+)?(\w+)$", trace.communicate()[1], re.M)
    return {name: int(count) / WATCH_S for count, name in found if name != "total"}


def instructions(pid, folder):
    """In a second."""
    dump = ["callgrind_control", "-d", str(pid)]
    subprocess.run(dump, check=True, stdout=subprocess.DEVNULL)
    begun, before = time.monotonic(), set(folder.glob("callgrind.*"))
    time.sleep(WATCH_S)
    subprocess.run(dump, check=True, stdout=subprocess.DEVNULL)
    took = time.monotonic() - begun
    for path in set(folder.glob("callgrind.*")) - before:
        total = re.search(r"^(?:totals|summary): (\d+)", path.read_text(), re.M)
        if total:
            return int(total[1]) / took
    raise RuntimeError("callgrind has written nothing")


if __name__ == "__main__":
    import daemon
    import tempfile
    build = Path(sys.argv[1])
    with tempfile.TemporaryDirectory(prefix="iwheel-bench-") as name:
        what = sys.argv[2]
        pair = daemon.Pair(build, name, ["valgrind", "--tool=callgrind", "--compress-strings=no", "--compress-pos=no", f"--callgrind-out-file={name}/callgrind.out"] if what == "instructions" else [])
        try:
            daemon.Client(pair.northbound).close()
            time.sleep(2)
            for state in STATES:
                if what == "instructions":
                    print(state, round(in_state(pair, daemon.Client, state, lambda: instructions(pair.gateway.pid, Path(name))) / FRAMES_S), flush=True)
                    keep = sys.argv[3:]
                    if keep:
                        newest = sorted(Path(name).glob("callgrind.out.*"), key=os.path.getmtime)[-1]
                        shutil.copy(newest, f"{keep[0]}/{state.replace(' ', '_')}.callgrind")
                else:
                    of = in_state(pair, daemon.Client, state, lambda: calls(pair.gateway.pid))
                    print(state, round(sum(of.values()) / FRAMES_S, 2), {k: round(v) for k, v in of.items()}, flush=True)
        finally:
            pair.end()
