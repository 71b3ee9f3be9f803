# SPDX-License-Identifier: MIT
"""The cost of the gateway's loop in the states of its users: instructions (callgrind) and system calls (strace) per received frame.

The gateway runs as a process over the local bus at the nominal 617 frames/s. Frames come when the simulator is woken, so the figures vary by a few per cent:
they are compared with limits. A machine under load makes them smaller, never larger.
"""

import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parent.parent / "support"))
from verdict import Witness, now_us

FRAMES_S = 617
WATCH_S = 2.0
COMMANDS_S = 20  # Commands of a client that drives, in a second.
SETTLE_S = 0.7


def quiet(_client, _quit_it):
    """A client that is only connected."""


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
    """A client that is armed and drives until the end."""
    for _ in range(100):
        if client.ask(cmd="arm", name="bench")["ok"]:
            break
        time.sleep(0.1)
    client.driving = threading.Thread(target=keep_driving, args=(client, quit_it), daemon=True)
    client.driving.start()


def drive_once(client):
    client.reply = client.ask(cmd="drive", left_mm_s=100, right_mm_s=100)
    return client.reply["ok"]


def reason(client):
    """The reason for a stop of the gateway while a client drove: the client's refusal and the gateway's last stop."""
    refusal = {key: value for key, value in getattr(client, "reply", {}).items() if key in ("error", "message")}
    try:
        stop = client.ask(cmd="why")
    except (OSError, ValueError) as silence:
        return f"refused: {refusal}; it does not answer why: {silence}"
    return f"refused: {refusal}; its last stop: { {key: value for key, value in stop.items() if not key.startswith('frames_')} }"


def keep_driving(client, quit_it):
    while drive_once(client) and not quit_it.wait(1 / COMMANDS_S):
        pass


# The work of a state, and the number of its clients: the most expensive first.
STATES = {"driving": (drive, 1), "one client watching at 50 Hz": (watch, 1), "one client": (quiet, 1), "no client": (None, 0)}
# Limits of system calls and of instructions. Tracing delays a driving gateway, so its instructions are not counted.
LIMITS = {"driving": (2.5, None), "one client watching at 50 Hz": (2.5, 7000), "one client": (2.5, 3000), "no client": (2.5, 1050)}


def in_state(pair, client_type, state, count):
    """The result of `count()` while the gateway is in that state."""
    begin, clients = STATES[state]
    quit_it = threading.Event()
    connected = [client_type(pair.northbound) for _ in range(clients)]
    try:
        for client in connected:
            begin(client, quit_it)
        time.sleep(SETTLE_S)
        figure = count()
        if begin is drive:
            for client in connected:
                if not client.driving.is_alive():
                    raise RuntimeError(f"the gateway has stopped, {reason(client)}")
        return figure
    finally:
        quit_it.set()
        time.sleep(2 / COMMANDS_S)
        for client in connected:
            client.socket.shutdown(2)
            client.close()
        time.sleep(SETTLE_S)


def calls(pid):
    """System calls per second. Reading a clock is not one: the kernel maps it."""
    trace = subprocess.Popen(["strace", "-f", "-c", "-q", "-p", str(pid)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    time.sleep(WATCH_S)
    trace.send_signal(signal.SIGINT)
    output = trace.communicate()[1]
    total = re.search(r"^\s*100\.00\s+\S+\s+\S+\s+(\d+).*total$", output, re.M)
    if total is None:
        raise RuntimeError(f"strace has counted nothing: {output.strip()[-200:]}")
    return int(total[1]) / WATCH_S


def instructions(pid, folder):
    """Instructions per second. Callgrind restarts its count after it has written a file, so the time between two files counts, not between our requests."""
    dump = ["callgrind_control", "-d", str(pid)]
    begun, _ = written_by(dump, folder)
    time.sleep(WATCH_S)
    ended, counted = written_by(dump, folder)
    if begun is None or ended is None:
        raise RuntimeError("callgrind has written nothing")
    return counted / (ended - begun)


def written_by(dump, folder):
    """The time when callgrind wrote the requested file, and the instructions in it."""
    before = set(folder.glob("callgrind.*"))
    subprocess.run(dump, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    for path in set(folder.glob("callgrind.*")) - before:
        total = re.search(r"^(?:totals|summary): (\d+)", path.read_text(), re.M)
        if total:
            return path.stat().st_mtime, int(total[1])
    return None, 0


def trial(pair, client_type, state, count, witness):
    """The same, repeated only if the gateway stopped while the machine stalled."""
    for left in (2, 1, 0):
        begin_us = now_us()
        try:
            return in_state(pair, client_type, state, count)
        except RuntimeError as stopped:
            if left == 0 or not witness.stalls(begin_us, now_us()):
                raise
            print(f"{state}: {stopped}, while the machine stalled; repeated", flush=True)
    return None


def rows(build, pair_type, client_type):
    """(state, system calls and instructions per frame), the most expensive first; None: not measured. A figure above its limit is measured once more:
    wake-ups that coincide vary by chance, and the smaller figure is the cost of the loop."""
    found = measured(build, pair_type, client_type)
    if any(
        figure is not None and limit is not None and figure > limit for state, *figures in found for figure, limit in zip(figures, LIMITS[state], strict=True)
    ):
        print("above a limit; once more", flush=True)
        again = {state: figures for state, *figures in measured(build, pair_type, client_type)}
        found = [
            (state, *(figure if figure is None else min(figure, other) for figure, other in zip(figures, again[state], strict=True)))
            for state, *figures in found
        ]
    return found


def measured(build, pair_type, client_type):
    # Callgrind in the gateway's child processes may write its last file after the gateway has ended.
    with tempfile.TemporaryDirectory(prefix="iwheel-bench-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        called = of_all(build, folder / "calls", pair_type, client_type, [], STATES, calls) if shutil.which("strace") else {}
        under = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={folder}/counted/callgrind.out"]
        counted = of_all(
            build,
            folder / "counted",
            pair_type,
            client_type,
            under,
            [state for state in STATES if LIMITS[state][1]],
            lambda pid: instructions(pid, folder / "counted"),
        )
    return [(state, called.get(state), counted.get(state)) for state in STATES]


def of_all(build, folder, pair_type, client_type, under, states, count):
    folder.mkdir()
    pair, witness = pair_type(build, folder, under), Witness()
    try:
        client_type(pair.northbound).close()
        time.sleep(2 * SETTLE_S)
        return {state: trial(pair, client_type, state, lambda: count(pair.gateway.pid), witness) / FRAMES_S for state in states}
    finally:
        pair.end()
        witness.close()
