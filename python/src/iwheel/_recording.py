# SPDX-License-Identifier: MIT
"""Reads recordings. `iwheelctl` decodes the frames and replays the gateway's core; this package has no decoder of its own."""

from __future__ import annotations

import csv
import importlib
import os
import shutil
import subprocess
import tempfile
from typing import IO, Any, NamedTuple, cast
from collections.abc import Iterator

from ._errors import IWheelError
from ._protocol import State

COLUMNS = (
    "time_s",
    "state",
    *(f"{side}_{value}" for side in ("left", "right") for value in ("commanded_m_s", "applied_m_s", "measured_m_s", "net_force_N")),
    "event",
    "text",
)
BAD_LINES = 65
"""Exit status of iwheelctl: it left out lines that it cannot read, and has reported them."""


class RecordingError(IWheelError):
    """A recording cannot be read or written. The message states cause and fix."""


class WheelSample(NamedTuple):
    """One wheel at one time, in the machine's sense: positive is forward. None means unknown."""

    commanded_m_s: float | None
    """Speed that the client commands, after limits."""
    applied_m_s: float | None
    """Speed of the last setpoint in the recording; None: there was none in the last 0.5 s."""
    measured_m_s: float | None
    """Speed that the wheel reports; None: it is offline."""
    net_force_N: float | None
    """Force without the offset; None: it is not valid."""


class Sample(NamedTuple):
    """Both wheels at one time."""

    time_s: float
    """Seconds since 1970, by the clock of the machine that recorded it."""
    state: State | None
    """State of the gateway; None: the recording has frames only."""
    left: WheelSample
    right: WheelSample


class RecordedEvent(NamedTuple):
    """An event of a recording: a request, a stop, a fault, a change of a state."""

    time_s: float
    state: State | None
    event: str
    """Kind of the event: `stop`, `fault`, `drive`, `state`, `wheel`, `force` ..."""
    text: str


class Recording:
    """A recording that was read. `samples`: 50 per second, in order; `events`: in order; `complaints`: lines of the file that are left out, and why."""

    def __init__(self, samples: list[Sample], events: list[RecordedEvent], complaints: tuple[str, ...]) -> None:
        self.samples = samples
        self.events = events
        self.complaints = complaints

    def to_pandas(self) -> Any:
        """Returns the samples as a pandas.DataFrame. The unit is the last part of a column's name: `left_measured_m_s`. NaN means unknown."""
        pandas: Any = importlib.import_module("pandas")
        rows = [(sample.time_s, sample.state, *sample.left, *sample.right) for sample in self.samples]
        frame = pandas.DataFrame(rows, columns=COLUMNS[:-2])
        numbers = [column for column in COLUMNS[:-2] if column != "state"]
        return frame.astype(dict.fromkeys(numbers, "float64"))


def iwheelctl() -> str:
    """Returns the path of iwheelctl: $IWHEELCTL, or the one in $PATH."""
    path = os.environ.get("IWHEELCTL") or shutil.which("iwheelctl")
    if path is None:
        raise RecordingError("iwheelctl is not installed; install it (apt-get install ./iwheel-tools_*.deb), or set IWHEELCTL to its path")
    return path


def start_samples(path: str, config: str | None, interface: str | None, errors: IO[bytes] | None) -> subprocess.Popen[bytes]:
    """Starts iwheelctl, which writes the table of the samples to its standard output."""
    words = [iwheelctl(), "replay", path, "--samples"]
    words += ["--config", config] if config else []
    words += ["--interface", interface] if interface else []
    try:
        return subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=errors)
    except OSError as error:
        raise RecordingError(f"{words[0]} cannot be started: {error.strerror}; set IWHEELCTL to the path of iwheelctl") from error


def _wheel(cells: list[str]) -> WheelSample:
    return WheelSample(*(float(cell) if cell else None for cell in cells))


def _read_rows(rows: Iterator[list[str]], samples: list[Sample], events: list[RecordedEvent]) -> None:
    names = next(rows, None)
    if names is None:
        return
    if tuple(names) != COLUMNS:
        raise RecordingError("iwheelctl writes another table than this package reads; install both in the same version")
    for row in rows:
        time_s, state = float(row[0]), cast("State | None", row[1] or None)
        if row[10]:
            events.append(RecordedEvent(time_s, state, row[10], row[11]))
        else:
            samples.append(Sample(time_s, state, _wheel(row[2:6]), _wheel(row[6:10])))


def read_recording(path: str | os.PathLike[str], *, config: str | None = None, interface: str | None = None) -> Recording:
    """Reads a recording: FILE.log in the form of candump -L.

    Next to a recording of the gateway are its requests (.jsonl) and its configuration (.conf): with them the recording has states, commands and
    events. Other recordings have frames only. `config`: the gateway's configuration, for signs and units of force (default: the one next to the
    recording, or as in the wheels' document). `interface`: read only the frames of this interface.

    Raises RecordingError if it cannot be read. If only some lines cannot be read, they are in `complaints`.
    """
    samples: list[Sample] = []
    events: list[RecordedEvent] = []
    with tempfile.TemporaryFile() as errors:
        process = start_samples(os.fspath(path), config, interface, errors)
        assert process.stdout is not None
        with process, os.fdopen(os.dup(process.stdout.fileno()), encoding="utf-8", newline="") as table:
            _read_rows(csv.reader(table), samples, events)
        errors.seek(0)
        lines = tuple(line.removeprefix("iwheelctl: ") for line in errors.read().decode(errors="replace").splitlines())
    if process.returncode not in (0, BAD_LINES) or not samples:
        raise RecordingError("; ".join(lines) or f"{path}: iwheelctl ended with status {process.returncode}")
    return Recording(samples, events, lines)
