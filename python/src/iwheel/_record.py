# SPDX-License-Identifier: MIT
"""Writes the frames of the bus to a file, in the form of candump -L."""

from __future__ import annotations

import contextlib
import os
import time
from typing import TYPE_CHECKING

from ._errors import IWheelError
from ._protocol import FrameEvent

if TYPE_CHECKING:
    from ._gateway import Gateway
    from ._types import Event

POLL_S = 0.2
"""Longest wait for a frame, after which the time is checked and the file is written."""


def line_of(frame: FrameEvent, wall_less_us: int, interface: str) -> str:
    """Returns the line of a frame. `T` marks a frame that the gateway sent."""
    time_us = frame["t_us"] + wall_less_us
    number = f"{frame['id']:08X}" if "extended" in frame["flags"] else f"{frame['id']:03X}"
    mark = "##0" if "fd" in frame["flags"] else "#"
    data = "R" if "remote" in frame["flags"] else frame["data"].upper()
    sender = "T" if frame["kind"] == "echo" else "R"
    return f"({time_us // 1_000_000}.{time_us % 1_000_000:06}) {interface} {number}{mark}{data} {sender}\n"


def wall_less_monotonic_us(gateway: Gateway) -> int:
    status = gateway.status()
    return status["wall_us"] - status["t_us"]


def record(gateway: Gateway, path: str | os.PathLike[str], seconds: float) -> int:
    """See `Gateway.record`."""
    count = 0
    end = time.monotonic() + seconds
    with open(path, "x", encoding="utf-8") as file:
        bus = gateway.hello()["bus"]
        interface = "local" if bus.startswith("unix:") else bus
        wall_less_us = wall_less_monotonic_us(gateway)

        def take(event: Event) -> None:
            nonlocal count, wall_less_us
            if event["event"] == "frame":
                file.write(line_of(event, wall_less_us, interface))
                count += 1
            elif event["event"] == "lost":
                file.write(f"# {event['count']} frames are missing: this program was too slow\n")
            elif event["event"] == "disconnected":
                file.write("# the connection was lost; frames are missing\n")
            elif event["event"] == "reconnected":
                wall_less_us = wall_less_monotonic_us(gateway)

        gateway.watch("frame")
        try:
            while time.monotonic() < end:
                for event in gateway.events(timeout=min(POLL_S, max(0.0, end - time.monotonic()))):
                    take(event)
                    if time.monotonic() >= end:
                        break
                file.flush()
        finally:
            with contextlib.suppress(IWheelError):
                gateway.watch()  # Ends the subscription. Frames that came before its reply belong to the recording.
                for event in gateway.events(timeout=0.0):
                    take(event)
    return count
