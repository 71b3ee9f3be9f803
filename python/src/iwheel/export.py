# SPDX-License-Identifier: MIT
"""Writes a recording in a form that other tools open. `iwheelctl export` runs it.

    python3 -m iwheel.export RECORDING --to mcap|csv|blf|rosbag2 [--output FILE] [--config FILE] [--interface NAME]

csv: both wheels 50 times a second, and the events, in SI units. mcap: the same for Foxglove and PlotJuggler, as JSON with schemas (needs mcap).
blf: the frames for CANoe and other tools (needs python-can). rosbag2: the same values as mcap, as messages of ROS 2, in a folder (needs rosbags).
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
import tempfile
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
SPEEDS = ("commanded", "applied", "measured")
PACKAGES = {"mcap": ("mcap", ""), "blf": ("python-can", "apt-get install python3-can, or "), "rosbag2": ("rosbags", "")}
PROGRESS_FRAMES = 65536


def library(to: str, module: str) -> Any:
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package, other = PACKAGES[to]
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


class Table:
    """Writes the rows of the table as messages."""

    def __init__(self) -> None:
        self.state = ""
        self.rows = 0

    def add_state(self, time_ns: int, state: str) -> None:
        raise NotImplementedError

    def add_event(self, time_ns: int, event: str, text: str) -> None:
        raise NotImplementedError

    def add_wheel(self, side: str, time_ns: int, cells: list[str]) -> None:
        raise NotImplementedError

    def add_row(self, row: list[str]) -> None:
        time_ns = nanoseconds(row[0])
        self.rows += 1
        if row[1] != self.state:
            self.state = row[1]
            self.add_state(time_ns, row[1])
        if row[10]:
            self.add_event(time_ns, row[10], row[11])
        else:
            self.add_wheel("left", time_ns, row[2:6])
            self.add_wheel("right", time_ns, row[6:10])

    def read(self, table: IO[bytes]) -> None:
        rows = csv.reader(io.TextIOWrapper(table, encoding="utf-8", newline=""))
        if tuple(next(rows, COLUMNS)) != COLUMNS:
            raise RecordingError("iwheelctl writes another table than this package reads; install both in the same version")
        for row in rows:
            self.add_row(row)


class McapTable(Table):
    """Messages for Foxglove and PlotJuggler. A value that is not known is left out of its message."""

    def __init__(self, out: IO[bytes]) -> None:
        super().__init__()
        self.writer = library("mcap", "mcap.writer").Writer(out)
        self.writer.start(library=f"iwheel {__version__}")
        ids = {name: self.writer.register_schema(f"iwheel.{name}", "jsonschema", self.schema(fields)) for name, fields in SCHEMAS.items()}
        self.channels = {topic: self.writer.register_channel(topic, "json", ids[name]) for topic, name in TOPICS.items()}

    @staticmethod
    def schema(fields: dict[str, dict[str, str]]) -> bytes:
        return json.dumps({"type": "object", "properties": fields}).encode()

    def add(self, topic: str, time_ns: int, text: str) -> None:
        self.writer.add_message(self.channels[topic], time_ns, text.encode(), time_ns)

    def add_wheel(self, side: str, time_ns: int, cells: list[str]) -> None:
        values = ", ".join(f'"{name}": {cell}' for name, cell in zip(WHEEL, cells, strict=True) if cell)
        self.add(f"/{side}", time_ns, f"{{{values}}}")

    def add_state(self, time_ns: int, state: str) -> None:
        self.add("/state", time_ns, json.dumps({"state": state}))

    def add_event(self, time_ns: int, event: str, text: str) -> None:
        self.add("/event", time_ns, json.dumps({"event": event, "text": text}))


def write_mcap(options: argparse.Namespace, out: IO[bytes]) -> tuple[int, bool]:
    table = McapTable(out)
    status = samples(options, table.read)
    table.writer.finish()
    return status, table.rows > 0


class BagTable(Table):
    """Messages of ROS 2, with the topics and frames of iwheel-ros2 where it has them. A value that is not known has no message."""

    def __init__(self, writer: Any) -> None:
        super().__init__()
        self.writer = writer
        typesys = library("rosbag2", "rosbags.typesys")
        self.store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
        self.connections: dict[str, Any] = {}
        kinds = ("builtin_interfaces/msg/Time", "std_msgs/msg/Header", "std_msgs/msg/String", "geometry_msgs/msg/Vector3")
        self.time, self.header, self.string, self.vector = (self.store.types[kind] for kind in kinds)

    def add(self, topic: str, kind: str, time_ns: int, *fields: Any) -> None:
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, kind, typestore=self.store)
        self.writer.write(self.connections[topic], time_ns, self.store.serialize_cdr(self.store.types[kind](*fields), kind))

    def add_along_x(self, topic: str, name: str, time_ns: int, frame: str, x: str) -> None:
        """Adds a TwistStamped or WrenchStamped; their other components are 0."""
        zero, stamp = self.vector(0.0, 0.0, 0.0), self.time(*divmod(time_ns, 1_000_000_000))
        inner = self.store.types[f"geometry_msgs/msg/{name}"](self.vector(float(x), 0.0, 0.0), zero)
        self.add(topic, f"geometry_msgs/msg/{name}Stamped", time_ns, self.header(stamp, frame), inner)

    def add_wheel(self, side: str, time_ns: int, cells: list[str]) -> None:
        for name, cell in zip(SPEEDS, cells[:3], strict=True):
            if cell:
                self.add_along_x(f"/{side}/{name}", "Twist", time_ns, f"{side}_wheel", cell)
        if cells[3]:
            self.add_along_x(f"/{side}/wrench", "Wrench", time_ns, f"{side}_handle", cells[3])

    def add_state(self, time_ns: int, state: str) -> None:
        self.add("/state", "std_msgs/msg/String", time_ns, state)

    def add_event(self, time_ns: int, event: str, text: str) -> None:
        self.add("/event", "std_msgs/msg/String", time_ns, f"{event}: {text}")


def write_rosbag2(options: argparse.Namespace, path: str) -> tuple[int, bool]:
    rosbag2 = library("rosbag2", "rosbags.rosbag2")
    with rosbag2.Writer(path, version=8, storage_plugin=rosbag2.StoragePlugin.MCAP) as writer:
        table = BagTable(writer)
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


def write_bag(options: argparse.Namespace) -> int:
    """Writes the folder under its own name in a temporary one, and moves it when it is complete."""
    output = os.path.abspath(options.output)
    if os.path.lexists(output):
        raise FileExistsError
    with tempfile.TemporaryDirectory(dir=os.path.dirname(output)) as folder:
        bag = os.path.join(folder, os.path.basename(output))
        status, has_content = write_rosbag2(options, bag)
        if status in (0, BAD_LINES) and has_content:
            os.rename(bag, output)
    return status


def size(path: str) -> int:
    files = [entry.path for entry in os.scandir(path)] if os.path.isdir(path) else [path]
    return sum(os.stat(file).st_size for file in files)


def main() -> int:
    program = "iwheelctl export" if "IWHEELCTL" in os.environ else "iwheel.export"
    parser = argparse.ArgumentParser(prog=program, description="Writes a recording in a form that other tools open.")
    parser.add_argument("recording", metavar="RECORDING", help="FILE.log in the form of candump -L")
    parser.add_argument("--to", choices=(*FORMS, "rosbag2"), required=True, help="form of the new file")
    parser.add_argument("--output", metavar="FILE", help="new file (name of the recording, in this folder)")
    parser.add_argument("--config", metavar="FILE", help="the gateway's configuration (the one next to the recording)")
    parser.add_argument("--interface", metavar="NAME", help="only the frames of this interface")
    options = parser.parse_args()
    options.output = options.output or f"{os.path.splitext(os.path.basename(options.recording))[0]}.{options.to}"
    try:
        status = write_bag(options) if options.to == "rosbag2" else write(options)
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
        print(f"{options.output}: {size(options.output)} bytes", file=sys.stderr)
    return status


if __name__ == "__main__":
    sys.exit(main())
