#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Writes speed, force and battery of both wheels into a CSV file until Ctrl-C. Moves nothing.

usage: record_csv.py [--socket PATH] [--rate HZ] [--for SECONDS] FILE

What is not known is an empty field, never 0. A gateway that is not there is waited for, an hour at most; runs on when it restarts.
"""

import argparse
import csv
import sys
import time
from typing import Any

from iwheel import Gateway, GatewayUnavailable, IWheelError, ProtocolError

SIDES = ("left", "right")
FIELDS = ("commanded_mm_s", "applied_mm_s", "speed_mm_s", "force_raw_mN", "force_net_mN", "battery_dV", "distance_mm")
COLUMNS = ["time_s", "state", *(f"{side}_{field}" for side in SIDES for field in FIELDS)]


WAIT_S = 3600
"""A recording is often started before the machine is switched on."""


def say(text: str) -> None:
    print(f"record_csv.py: {text}", file=sys.stderr, flush=True)


def row_of(event: dict[str, Any], begin_us: int) -> list[Any]:
    """One line; None becomes an empty field."""
    values = [event[side][field] for side in SIDES for field in FIELDS]
    return [f"{(event['t_us'] - begin_us) / 1e6:.3f}", event["state"], *values]


def say_if_waiting(socket: str | None) -> None:
    """Silence would look as if it recorded. What cannot pass by itself is raised."""
    try:
        with Gateway(socket) as gateway:
            gateway.hello()
    except ProtocolError:
        raise
    except GatewayUnavailable as trouble:
        say(f"{trouble}. Waiting for the gateway, {WAIT_S // 60} minutes at most; Ctrl-C ends")


def note(event: dict[str, Any]) -> None:
    """What is not a line of the file is told."""
    if event["event"] == "disconnected":
        say(f"{event['message']}. Waiting until the gateway is back; Ctrl-C ends")
    elif event["event"] == "reconnected":
        say("the gateway is back; recording")
    elif event["event"] == "lost":
        say(f"{event['count']} lines are missing: this machine was too slow")


def record(options: argparse.Namespace, rows: list[int]) -> None:
    """`rows` counts the lines, also for who is interrupted."""
    with open(options.file, "w", newline="", encoding="utf-8") as file, Gateway(options.socket, wait=WAIT_S) as gateway:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        say_if_waiting(options.socket)
        granted = gateway.watch("state", rate_hz=options.rate)
        say(f"recording {granted['rate_hz']} lines a second into {options.file}; Ctrl-C ends")
        begin_us, end = None, time.monotonic() + options.seconds
        while time.monotonic() < end:  # Also while the gateway is away.
            for event in gateway.events(timeout=0.5):
                if event["event"] == "state":
                    begin_us = event["t_us"] if begin_us is None else begin_us
                    writer.writerow(row_of(event, begin_us))
                    file.flush()
                    rows[0] += 1
                else:
                    note(event)
                if time.monotonic() > end:
                    break


def main() -> int:
    parser = argparse.ArgumentParser(description="Writes what the wheels do into a CSV file. Moves nothing.")
    parser.add_argument("file", metavar="FILE")
    parser.add_argument("--socket", help="of the gateway; else $IWHEEL_SOCKET, else the only one in /run/iwheel")
    parser.add_argument("--rate", type=int, default=20, help="lines per second (20)")
    parser.add_argument("--for", dest="seconds", type=float, default=float("inf"), help="seconds from its first line; else until Ctrl-C")
    options, rows = parser.parse_args(), [0]
    try:
        record(options, rows)
    except KeyboardInterrupt:
        pass
    except (IWheelError, OSError) as error:
        say(str(error))
        return 1
    say(f"{rows[0]} lines in {options.file}" if rows[0] else "nothing was recorded")
    return 0


if __name__ == "__main__":
    sys.exit(main())
