#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Writes speed, force and battery of both wheels to a CSV file until Ctrl-C. Moves nothing.

usage: record_csv.py [--socket PATH] [--rate HZ] [--for SECONDS] FILE

An unknown value is an empty field, never 0. The program waits for a gateway that is not running, at most an hour, and continues after its restart.
"""

import argparse
import csv
import sys
import time
from collections.abc import Mapping
from typing import Any

from iwheel import Event, Gateway, GatewayUnavailable, IWheelError, ProtocolError, StateEvent

SIDES = ("left", "right")
FIELDS = ("commanded_mm_s", "applied_mm_s", "speed_mm_s", "force_raw_mN", "force_net_mN", "battery_dV", "distance_mm")
COLUMNS = ["time_s", "state", *(f"{side}_{field}" for side in SIDES for field in FIELDS)]


WAIT_S = 3600
"""Longest wait: people often start a recording before they switch the machine on."""


def report(text: str) -> None:
    print(f"record_csv.py: {text}", file=sys.stderr, flush=True)


def row_of(event: StateEvent, begin_us: int) -> list[Any]:
    """Returns one line; None becomes an empty field."""
    wheels: tuple[Mapping[str, Any], ...] = (event["left"], event["right"])
    values = [wheel[field] for wheel in wheels for field in FIELDS]
    return [f"{(event['t_us'] - begin_us) / 1e6:.3f}", event["state"], *values]


def report_if_waiting(socket: str | None) -> None:
    """Reports that the gateway is not running; without a message the program would seem to record. Raises an error that waiting cannot fix."""
    try:
        with Gateway(socket) as gateway:
            gateway.hello()
    except ProtocolError:
        raise
    except GatewayUnavailable as trouble:
        report(f"{trouble}. Waiting for the gateway, {WAIT_S // 60} minutes at most; Ctrl-C ends")


def note(event: Event) -> None:
    """Reports an event that is not a line of the file."""
    if event["event"] == "disconnected":
        report(f"{event['message']}. Waiting until the gateway is back; Ctrl-C ends")
    elif event["event"] == "reconnected":
        report("the gateway is back; recording")
    elif event["event"] == "lost":
        report(f"{event['count']} lines are missing: this machine was too slow")


def record(options: argparse.Namespace, rows: list[int]) -> None:
    """Writes the file. `rows` counts the lines, so that the caller has the number also after an interruption."""
    with open(options.file, "w", newline="", encoding="utf-8") as file, Gateway(options.socket, wait=WAIT_S) as gateway:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        report_if_waiting(options.socket)
        granted = gateway.watch("state", rate_hz=options.rate)
        report(f"recording {granted['rate_hz']} lines a second into {options.file}; Ctrl-C ends")
        begin_us, end = None, time.monotonic() + options.seconds
        while time.monotonic() < end:  # The time also runs while the gateway is down.
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
    parser = argparse.ArgumentParser(description="Writes speed, force and battery of the wheels to a CSV file. Moves nothing.")
    parser.add_argument("file", metavar="FILE")
    parser.add_argument("--socket", help="socket of the gateway ($IWHEEL_SOCKET, or the only one in /run/iwheel)")
    parser.add_argument("--rate", type=int, default=20, help="lines per second (20)")
    parser.add_argument("--for", dest="seconds", type=float, default=float("inf"), help="seconds from the first line (until Ctrl-C)")
    options, rows = parser.parse_args(), [0]
    try:
        record(options, rows)
    except KeyboardInterrupt:
        pass
    except (IWheelError, OSError) as error:
        report(str(error))
        return 1
    report(f"{rows[0]} lines in {options.file}" if rows[0] else "nothing was recorded")
    return 0


if __name__ == "__main__":
    sys.exit(main())
