#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Drives with the keys of a terminal: w a s d or the arrows, + and - for the speed, q to end. MOVES THE WHEELS.

usage: keys.py [--socket PATH] [--speed MM_S]

A terminal reports repeats of a key, not its release: each key counts as held for 0.6 s. The space bar and every other key stop immediately. The
computer makes the repeats: if the link of a wireless keyboard dies with a key held, they continue. Use a keyboard with a cable.

A key that was pressed before "armed" moves nothing: let go of it, then press it again.
"""

import argparse
import os
import select
import sys
import termios
import time
import tty

from iwheel import Gateway, IWheelError

HOLD_S = 0.6
"""Longer than the pause before a keyboard begins to repeat; otherwise the wheels would stutter."""
DIRECTIONS = {
    "w": (1, 1), "\x1b[A": (1, 1), "s": (-1, -1), "\x1b[B": (-1, -1),
    "a": (-1, 1), "\x1b[D": (-1, 1), "d": (1, -1), "\x1b[C": (1, -1),
}  # fmt: skip


def read_key(seconds: float) -> str:
    """Returns the last key; empty if none came. Returns q at the end of the input."""
    if not select.select([0], [], [], seconds)[0]:
        return ""
    text = os.read(0, 100).decode(errors="replace") or "q"
    return text[-3:] if text[-3:-1] == "\x1b[" else text[-1]


def read_early() -> str:
    """Returns all that was typed so far. It must not move the wheels."""
    return (os.read(0, 65536).decode(errors="replace") or "q") if select.select([0], [], [], 0)[0] else ""


def steer(socket: str | None, speed: int) -> None:
    direction, until = (0, 0), 0.0
    with Gateway(socket) as gateway, gateway.arm("keys") as wheels:
        early = read_early()
        if "q" in early or "\x03" in early:
            return
        fresh_from = time.monotonic() + HOLD_S if early else 0.0
        print("armed: w a s d drive, space stops, + - speed, q ends", end="\r\n")
        while True:
            key = read_key(wheels.terms.lease_ms / 3000)
            if key in ("q", "\x03"):
                return
            if key in DIRECTIONS and time.monotonic() < fresh_from:
                fresh_from = time.monotonic() + HOLD_S  # It may have been held since before the wheels were armed.
            elif key in DIRECTIONS:
                direction, until = DIRECTIONS[key], time.monotonic() + HOLD_S
            elif key in ("+", "-"):
                speed = min(1000, max(50, speed + (50 if key == "+" else -50)))
            elif key or time.monotonic() > until:
                direction = (0, 0)
            applied = wheels.drive(speed * direction[0], speed * direction[1])
            print(f"  speed {speed} mm/s   left {applied.left_mm_s:5d}   right {applied.right_mm_s:5d} mm/s ", end="\r")


def main() -> int:
    parser = argparse.ArgumentParser(description="Drives the wheels with the keys of a terminal. MOVES THE WHEELS.")
    parser.add_argument("--socket", help="socket of the gateway ($IWHEEL_SOCKET, or the only one in /run/iwheel)")
    parser.add_argument("--speed", type=int, default=200, help="mm/s at the start (200)")
    options = parser.parse_args()
    terminal = termios.tcgetattr(0) if os.isatty(0) else None
    try:
        if terminal:
            tty.setraw(0)
        steer(options.socket, options.speed)
        return 0
    except IWheelError as error:
        print(f"\r\n{error}", end="\r\n", file=sys.stderr)
        return 1
    finally:
        if terminal:
            termios.tcsetattr(0, termios.TCSADRAIN, terminal)
        print()


if __name__ == "__main__":
    sys.exit(main())
