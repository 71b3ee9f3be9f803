# SPDX-License-Identifier: MIT
"""Writes a recording in a form that other tools open. `iwheelctl export` runs it.

    python3 -m iwheel.export RECORDING --to mcap|csv|blf [--output FILE] [--config FILE] [--interface NAME]

csv: both wheels 50 times a second, and the events, in SI units. mcap: the same for Foxglove and PlotJuggler, as JSON with schemas (needs mcap).
blf: the frames for CANoe and other tools (needs python-can).
"""

from __future__ import annotations

import argparse
import csv
import importlib
import io
import json
import os
import shutil
import sys
from typing import IO, Any, TextIO
from collections.abc import Callable, Iterator

from ._errors import IWheelError
from ._recording import BAD_LINES, COLUMNS, RecordingError, start_samples
from ._version import __version__

WHEEL = ("commanded_m_s", "applied_m_s", "measured_m_s", "net_force_N")
NUMBER = {"type": "number"}
TEXT = {"type": "string"}
SCHEMAS = {"wheel": dict.fromkeys(WHEEL, NUMBER), "state": {"state": TEXT}, "event": {"event": TEXT, "text": TEXT}}
TOPICS = {"/left": "wheel", "/right": "wheel", "/state": "state", "/event": "event"}
PROGRESS_FRAMES = 65536


def library(to: str, module: str) -> Any:
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package, other = {"mcap": ("mcap", ""), "blf": ("python-can", "apt-get install python3-can, or ")}[to]
        fix = f"{other}in a virtual environment {sys.executable} -m pip install {package}"
        raise RecordingError(f"--to {to} needs the Python package {package}; install it: {fix}") from error


def samples(options: argparse.Namespace, use: Callable[[IO[bytes]], None]) -> int:
    """Passes the table of iwheelctl to `use`. Its messages and its progress go to this program's standard error. Returns its exit status."""
    process = start_samples(options.recording, options.config, options.interface, None)
    assert process.stdout is not None
    with process:
        use(process.stdout)
    return process.returncode


def write_csv(options: argparse.Namespace, out: IO[bytes]) -> tuple[int, bool]:
    status = samples(options, lambda table: shutil.copyfileobj(table, out, 1 << 20))
    return status, out.tell() > len(",".join(COLUMNS)) + 1


def nanoseconds(text: str) -> int:
    """Converts a time of the table, seconds with six decimals, without rounding."""
    seconds, _, micros = text.partition(".")
    return int(seconds) * 1_000_000_000 + int(micros) * 1000


class McapTable:
    """Writes the rows of the table as messages. A value that is not known is left out of its message."""

    def __init__(self, out: IO[bytes]) -> None:
        self.writer = library("mcap", "mcap.writer").Writer(out)
        self.writer.start(library=f"iwheel {__version__}")
        ids = {name: self.writer.register_schema(f"iwheel.{name}", "jsonschema", self.schema(fields)) for name, fields in SCHEMAS.items()}
        self.channels = {topic: self.writer.register_channel(topic, "json", ids[name]) for topic, name in TOPICS.items()}
        self.state = ""
        self.rows = 0

    @staticmethod
    def schema(fields: dict[str, dict[str, str]]) -> bytes:
        return json.dumps({"type": "object", "properties": fields}).encode()

    def add(self, topic: str, time_ns: int, text: str) -> None:
        self.writer.add_message(self.channels[topic], time_ns, text.encode(), time_ns)

    def add_wheel(self, topic: str, time_ns: int, cells: list[str]) -> None:
        values = ", ".join(f'"{name}": {cell}' for name, cell in zip(WHEEL, cells, strict=True) if cell)
        self.add(topic, time_ns, f"{{{values}}}")

    def add_row(self, row: list[str]) -> None:
        time_ns = nanoseconds(row[0])
        self.rows += 1
        if row[1] != self.state:
            self.state = row[1]
            self.add("/state", time_ns, json.dumps({"state": row[1]}))
        if row[10]:
            self.add("/event", time_ns, json.dumps({"event": row[10], "text": row[11]}))
        else:
            self.add_wheel("/left", time_ns, row[2:6])
            self.add_wheel("/right", time_ns, row[6:10])

    def read(self, table: IO[bytes]) -> None:
        rows = csv.reader(io.TextIOWrapper(table, encoding="utf-8", newline=""))
        if tuple(next(rows, COLUMNS)) != COLUMNS:
            raise RecordingError("iwheelctl writes another table than this package reads; install both in the same version")
        for row in rows:
            self.add_row(row)
        self.writer.finish()


def write_mcap(options: argparse.Namespace, out: IO[bytes]) -> tuple[int, bool]:
    table = McapTable(out)
    return samples(options, table.read), table.rows > 0


class Lines:
    """The lines of a recording for python-can, which knows no comments. Prints the progress on a terminal."""

    def __init__(self, file: TextIO) -> None:
        self.number = 0
        self._file = file
        self._size = max(1, os.fstat(file.fileno()).st_size)
        self._shows = sys.stderr.isatty()
        self._there = 0

    def __iter__(self) -> Iterator[str]:
        for line in self._file:
            self.number += 1
            self._there += len(line)
            if self._shows and self.number % PROGRESS_FRAMES == 0:
                print(f"\r{100 * self._there // self._size:3} %\r", end="", file=sys.stderr, flush=True)
            if not line.startswith(("#", ";")):
                yield line

    def read(self, size: int = -1) -> str:
        """python-can requires it of a file."""
        return self._file.read(size)

    write = read

    def close(self) -> None:
        """The caller closes the file."""


def frames(can: Any, lines: Lines, interface: str | None) -> Iterator[Any]:
    try:
        for frame in can.CanutilsLogReader(lines):
            if interface is None or frame.channel == interface:
                yield frame
    except (ValueError, IndexError) as error:
        raise RecordingError(f"line {lines.number} is no frame; to see what is wrong: iwheelctl decode FILE") from error


def write_blf(options: argparse.Namespace, out: IO[bytes]) -> tuple[int, bool]:
    can = library("blf", "can")
    if options.config:
        raise RecordingError("--to blf writes the frames as they are, so it has no use for --config")
    channels: dict[Any, int] = {}
    count = 0
    with open(options.recording, encoding="utf-8-sig") as file, can.BLFWriter(out) as writer:
        for frame in frames(can, Lines(file), options.interface):
            frame.channel = channels.setdefault(frame.channel, len(channels))  # BLF numbers the channels.
            writer.on_message_received(frame)
            count += 1
    if count == 0:
        raise RecordingError("it has no frame" + (f" of interface {options.interface}" if options.interface else ""))
    return 0, True


Form = Callable[[argparse.Namespace, IO[bytes]], tuple[int, bool]]
"""Writes the file. Returns the exit status, and whether the file has any content."""
FORMS: dict[str, Form] = {"csv": write_csv, "mcap": write_mcap, "blf": write_blf}


def write(options: argparse.Namespace) -> int:
    """Writes the file. Removes it again if the recording cannot be read."""
    done = False
    with open(options.output, "xb") as out:
        try:
            status, has_content = FORMS[options.to](options, out)
            done = status in (0, BAD_LINES) and has_content
        finally:
            if not done:
                os.unlink(options.output)
    return status


def main() -> int:
    program = "iwheelctl export" if "IWHEELCTL" in os.environ else "iwheel.export"
    parser = argparse.ArgumentParser(prog=program, description="Writes a recording in a form that other tools open.")
    parser.add_argument("recording", metavar="RECORDING", help="FILE.log in the form of candump -L")
    parser.add_argument("--to", choices=FORMS, required=True, help="form of the new file")
    parser.add_argument("--output", metavar="FILE", help="new file (name of the recording, in this folder)")
    parser.add_argument("--config", metavar="FILE", help="the gateway's configuration (the one next to the recording)")
    parser.add_argument("--interface", metavar="NAME", help="only the frames of this interface")
    options = parser.parse_args()
    options.output = options.output or f"{os.path.splitext(os.path.basename(options.recording))[0]}.{options.to}"
    try:
        status = write(options)
    except FileExistsError:
        print(f"{program}: {options.output} exists; name another file: --output FILE", file=sys.stderr)
        return 73
    except OSError as error:
        print(f"{program}: {error.filename or options.recording}: {error.strerror}", file=sys.stderr)
        return 65
    except IWheelError as error:
        print(f"{program}: {options.recording}: {error}", file=sys.stderr)
        return 65
    if os.path.exists(options.output):
        print(f"{options.output}: {os.stat(options.output).st_size} bytes", file=sys.stderr)
    return status


if __name__ == "__main__":
    sys.exit(main())
