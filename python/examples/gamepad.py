#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Drives with a gamepad while its dead man's button is held. MOVES THE WHEELS.

usage: gamepad.py [--socket PATH] [--device /dev/input/js0] [--speed MM_S] [--yaw MRAD_S] [--button N]

The left stick sets speed and yaw rate, but only while the button (4: usually the left shoulder) is held. The wheels stop when the button is
released, and when the device disappears (unplugged).

A wireless gamepad whose link has died reports nothing, while its receiver stays connected. The wheels therefore also stop 2 s after the last report;
after 1 s the program prints a warning. Move the stick slightly to drive on. After such a stop release the button and press it again.

A button that was pressed before "armed" moves nothing: release it, then press it again.
"""

import argparse
import os
import select
import struct
import sys
import time

from iwheel import Gateway, IWheelError

EVENT = struct.Struct("=IhBB")  # struct js_event of linux/joystick.h: time, value, type, number
BUTTON, AXIS, INITIAL = 0x01, 0x02, 0x80
FULL = 32767
CENTRE = 3000
"""Dead zone: a released stick is not exactly in the middle."""
WARN_S, HELD_S = 1.0, 2.0
"""Seconds without a report of the device until the program warns, and until the button no longer counts as held."""


class Gamepad:
    """State of the gamepad. Raises OSError or EOFError when the gamepad is gone."""

    def __init__(self, device: str) -> None:
        self.file = os.open(device, os.O_RDONLY | os.O_NONBLOCK)
        self.axes = {0: 0, 1: 0}
        self.buttons: set[int] = set()
        self.at_start: set[int] = set()
        """Buttons that the kernel reports as pressed at the start. A hand need not hold them."""
        self.pending = b""
        self.reported = time.monotonic()
        """Time of the last report of the device, which shows that a hand holds it."""

    def update(self, seconds: float) -> None:
        if not select.select([self.file], [], [], seconds)[0]:
            return
        data = os.read(self.file, 64 * EVENT.size)
        if not data:
            raise EOFError("the gamepad is gone")
        self.pending += data
        while len(self.pending) >= EVENT.size:
            _, value, kind, number = EVENT.unpack(self.pending[: EVENT.size])
            self.pending = self.pending[EVENT.size :]
            if not kind & INITIAL:
                self.reported = time.monotonic()
            if kind & ~INITIAL == AXIS:
                self.axes[number] = value if abs(value) > CENTRE else 0
            elif value:
                (self.at_start if kind & INITIAL else self.buttons).add(number)
            else:
                self.buttons.discard(number)

    def begin(self) -> None:
        """Reads all that the device has reported so far. From now on only a new press of a button counts."""
        while select.select([self.file], [], [], 0)[0]:
            self.update(0)
        self.buttons.clear()

    def silent_s(self) -> float:
        """Seconds since the last report."""
        return time.monotonic() - self.reported


class Hold:
    """Decides whether the dead man's button counts as held: it is pressed, and the device has reported within HELD_S."""

    def __init__(self, gamepad: Gamepad, button: int) -> None:
        self.gamepad, self.button = gamepad, button
        self.warned = False

    def held(self) -> bool:
        silent_s = self.gamepad.silent_s()
        if self.button not in self.gamepad.buttons:
            self.warned = False
        elif silent_s >= HELD_S:
            self.gamepad.buttons.clear()  # Only a new press starts motion again, not the return of the link.
            print(f"stopped: no report of the gamepad for {HELD_S:g} s; let go of the button, then press it again", file=sys.stderr)
        elif silent_s >= WARN_S and not self.warned:
            self.warned = True
            print(f"no report of the gamepad for {WARN_S:g} s; move the stick, or the wheels stop", file=sys.stderr)
        elif silent_s < WARN_S:
            self.warned = False
        return self.button in self.gamepad.buttons


def steer(options: argparse.Namespace) -> None:
    gamepad = Gamepad(options.device)
    gamepad.update(0.2)
    if options.button in gamepad.buttons | gamepad.at_start:
        raise EOFError("the dead man's button is already held; let go of it, then start again")
    with Gateway(options.socket) as gateway, gateway.arm("gamepad") as wheels:
        gamepad.begin()
        print(f"armed: hold button {options.button} and steer with the left stick; Ctrl-C ends")
        hold = Hold(gamepad, options.button)
        while True:
            gamepad.update(wheels.terms.lease_ms / 3000)
            if hold.held():
                wheels.twist(-gamepad.axes[1] * options.speed // FULL, -gamepad.axes[0] * options.yaw // FULL)
            else:
                wheels.twist(0, 0)


def main() -> int:
    parser = argparse.ArgumentParser(description="Drives the wheels with a gamepad. MOVES THE WHEELS.")
    parser.add_argument("--socket", help="socket of the gateway ($IWHEEL_SOCKET, or the only one in /run/iwheel)")
    parser.add_argument("--device", default="/dev/input/js0", help="joystick device (/dev/input/js0)")
    parser.add_argument("--speed", type=int, default=400, help="mm/s with the stick fully forward (400)")
    parser.add_argument("--yaw", type=int, default=1000, help="mrad/s with the stick fully to the side (1000)")
    parser.add_argument("--button", type=int, default=4, help="number of the dead man's button (4)")
    try:
        steer(parser.parse_args())
    except KeyboardInterrupt:
        return 0
    except (IWheelError, EOFError, OSError) as error:
        print(f"gamepad.py: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
