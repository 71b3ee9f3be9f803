#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Writes speed, force and battery of both wheels into a CSV file until Ctrl-C. Moves nothing.

usage: record_csv.py [--socket PATH] [--rate HZ] [--for SECONDS] FILE

What is not known is an empty field, never 0. Runs on when the gateway restarts.
"""

import argparse
import csv
import sys
import time
from typing import Any

from iwheel import Gateway, IWheelError

SIDES = ("left", "right")
FIELDS = ("commanded_mm_s", "applied_mm_s", "speed_mm_s", "force_raw_mN", "force_net_mN", "battery_dV", "distance_mm")
COLUMNS = ["time_s", "state", *(f"{side}_{field}" for side in SIDES for field in FIELDS)]


def row_of(event: dict[str, Any], begin_us: int) -> list[Any]:
    """One line; None becomes an empty field."""
    values = [event[side][field] for side in SIDES for field in FIELDS]
    return [f"{(event['t_us'] - begin_us) / 1e6:.3f}", event["state"], *values]


def record(options: argparse.Namespace) -> int:
    rows, begin_us, end = 0, None, time.monotonic() + options.seconds
    with Gateway(options.socket, wait=3600) as gateway, open(options.file, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        gateway.watch("state", rate_hz=options.rate)
        for event in gateway.events():
            if event["event"] == "state":
                begin_us = event["t_us"] if begin_us is None else begin_us
                writer.writerow(row_of(event, begin_us))
                file.flush()
                rows += 1
            elif event["event"] in ("disconnected", "lost"):
                print(f"record_csv.py: {event['event']}: {event.get('message', event.get('count'))}", file=sys.stderr)
            if time.monotonic() > end:
                break
    return rows


def main() -> int:
    parser = argparse.ArgumentParser(description="Writes what the wheels do into a CSV file. Moves nothing.")
    parser.add_argument("file", metavar="FILE")
    parser.add_argument("--socket", help="of the gateway; else $IWHEEL_SOCKET, else the only one in /run/iwheel")
    parser.add_argument("--rate", type=int, default=20, help="lines per second (20)")
    parser.add_argument("--for", dest="seconds", type=float, default=float("inf"), help="seconds; else until Ctrl-C")
    try:
        record(parser.parse_args())
    except KeyboardInterrupt:
        return 0
    except IWheelError as error:
        print(f"record_csv.py: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
