# SPDX-License-Identifier: MIT
"""Draws the speeds and forces of both wheels while they turn, in a window. Moves nothing.

    python3 -m iwheel.plot [--socket PATH] [--seconds N] [--for SECONDS] [--save FILE]

It uses matplotlib, because that needs no browser, no account and no second program, and every distribution has it. For Foxglove and PlotJuggler
there is `iwheelctl export --to mcap`. Closing the window or Ctrl-C ends it.
"""

from __future__ import annotations

import argparse
import importlib
import math
import sys
import time
from collections import deque
from typing import Any

from ._errors import IWheelError
from ._gateway import Gateway
from ._protocol import StateEvent, WheelStatus

SIDES = ("left", "right")
COLOURS = {"left": "tab:blue", "right": "tab:orange"}
LINES = (("commanded_mm_s", ":", "commanded"), ("applied_mm_s", "--", "applied"), ("speed_mm_s", "-", "measured"))
RATE_HZ = 50
DRAW_S = 0.05


def number(value: int | None) -> float:
    """Returns a value of the protocol in the unit without milli; None becomes a gap in the line."""
    return math.nan if value is None else value / 1000


class History:
    """The values of the last seconds."""

    def __init__(self, seconds: float) -> None:
        length = max(2, round(seconds * RATE_HZ))
        self.times: deque[float] = deque(maxlen=length)
        self.values: dict[tuple[str, str], deque[float]] = {}
        for side in SIDES:
            for field in (*(line[0] for line in LINES), "force_net_mN"):
                self.values[side, field] = deque(maxlen=length)

    def add(self, event: StateEvent) -> None:
        self.times.append(event["t_us"] / 1e6)
        wheels: tuple[tuple[str, WheelStatus], ...] = (("left", event["left"]), ("right", event["right"]))
        for side, wheel in wheels:
            self.values[side, "commanded_mm_s"].append(number(wheel["commanded_mm_s"]))
            self.values[side, "applied_mm_s"].append(number(wheel["applied_mm_s"]))
            self.values[side, "speed_mm_s"].append(number(wheel["speed_mm_s"]))
            self.values[side, "force_net_mN"].append(number(wheel["force_net_mN"]))

    def add_gap(self) -> None:
        """Breaks the lines: the gateway was away."""
        if self.times:
            self.times.append(self.times[-1])
            for values in self.values.values():
                values.append(math.nan)


class Window:
    """The figure: speeds above, forces below."""

    def __init__(self, seconds: float) -> None:
        self.pyplot: Any = importlib.import_module("matplotlib.pyplot")
        self.seconds = seconds
        self.figure, (self.speeds, self.forces) = self.pyplot.subplots(2, 1, sharex=True, figsize=(9, 6))
        self.lines: dict[tuple[str, str], Any] = {}
        for side in SIDES:
            for field, style, label in LINES:
                (self.lines[side, field],) = self.speeds.plot([], [], style, color=COLOURS[side], label=f"{side}, {label}")
            (self.lines[side, "force_net_mN"],) = self.forces.plot([], [], color=COLOURS[side], label=side)
        self.speeds.set_ylabel("speed (m/s)")
        self.forces.set_ylabel("net force (N)")
        self.forces.set_xlabel("time (s)")
        self.speeds.legend(loc="upper left", ncol=2, fontsize="small")

    def draw(self, history: History, title: str) -> None:
        last = history.times[-1] if history.times else 0.0
        times = [time_s - last for time_s in history.times]
        for key, line in self.lines.items():
            line.set_data(times, list(history.values[key]))
        for axes in (self.speeds, self.forces):
            axes.relim()
            axes.autoscale_view(scalex=False)
        self.forces.set_xlim(-self.seconds, 0)
        self.speeds.set_title(title)
        self.figure.canvas.draw_idle()
        self.pyplot.pause(0.001)

    def is_open(self) -> bool:
        return bool(self.pyplot.fignum_exists(self.figure.number))


def run(options: argparse.Namespace) -> int:
    """Draws until the window is closed or the time is over. Returns the number of states that were read."""
    count, title = 0, "waiting for the gateway"
    history, window = History(options.seconds), Window(options.seconds)
    end = time.monotonic() + options.duration
    with Gateway(options.socket) as gateway:
        gateway.watch("state", rate_hz=RATE_HZ)
        while window.is_open() and time.monotonic() < end:
            until = time.monotonic() + DRAW_S
            while time.monotonic() < until:  # A slow window skips states, but shows the newest.
                for event in gateway.events(timeout=max(0.0, until - time.monotonic()), latest=False):
                    if event["event"] == "state":
                        history.add(event)
                        count += 1
                        title = event["state"] + (f": {event['cause']}" if event["cause"] else "")
                    elif event["event"] == "disconnected":
                        history.add_gap()
                        title = "the gateway is away"
                    if time.monotonic() >= until:
                        break
            window.draw(history, title)
    if options.save:
        window.figure.savefig(options.save, dpi=100)
    return count


def main() -> int:
    parser = argparse.ArgumentParser(prog="iwheel.plot", description="Draws the speeds and forces of both wheels, live. Moves nothing.")
    parser.add_argument("--socket", help="socket of the gateway ($IWHEEL_SOCKET, or the only one in /run/iwheel)")
    parser.add_argument("--seconds", type=float, default=20.0, help="seconds that the window shows (20)")
    parser.add_argument("--for", dest="duration", type=float, default=math.inf, help="seconds until it ends (until the window is closed)")
    parser.add_argument("--save", metavar="FILE", help="write the last picture to this file: .png, .svg or .pdf")
    options = parser.parse_args()
    try:
        count = run(options)
    except KeyboardInterrupt:
        return 0
    except ImportError:
        print(
            f"iwheel.plot: matplotlib is missing; install it: apt-get install python3-matplotlib, or {sys.executable} -m pip install matplotlib",
            file=sys.stderr,
        )
        return 69
    except (IWheelError, OSError) as error:
        print(f"iwheel.plot: {error}", file=sys.stderr)
        return 69
    print(f"iwheel.plot: {count} states", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
