# SPDX-License-Identifier: MIT
"""Drive a pair of iWheels through iwheel-gateway.

    from iwheel import Gateway

    with Gateway().arm("example") as wheels:
        wheels.drive_for(2.0, 200, 200)          # mm/s, left and right

The wheels stop however the block ends: at its end, by an exception, by Ctrl-C. If the program hangs, is killed or loses its
connection, the gateway stops them one lease (200 ms) after the last command. This package has no thread, no task and no timer
that could repeat a command.

`AsyncGateway` is the client for asyncio. Speeds are in mm/s, currents in mA, both integers as on the bus (numpy integers and 200.0
are accepted, 200.5 is not). None means unknown, never 0.
"""

from ._aio import AsyncArmed, AsyncGateway
from ._errors import ConnectionLost, GatewayUnavailable, IWheelError, LeaseEnded, NoAnswer, ProtocolError, Refused
from ._gateway import Armed, Gateway
from ._protocol import (
    BusEvent,
    Configured,
    ConfiguredEntry,
    Confirmed,
    EstopEvent,
    FaultEvent,
    ForceEvent,
    Frame,
    FrameEvent,
    Hello,
    HelloEvent,
    LeaseEvent,
    LedgerEntry,
    LedgerEvent,
    LostEvent,
    OffsetEvent,
    OnRequest,
    Piece,
    RecordingEntry,
    Recordings,
    RollingEvent,
    StateEvent,
    Status,
    Stop,
    StopEvent,
    StopSummary,
    Tared,
    Watched,
    WheelStatus,
)
from ._recording import RecordedEvent, Recording, RecordingError, Sample, WheelSample, read_recording
from ._types import Applied, DisconnectedEvent, Event, OnStatus, ReconnectedEvent, Terms, Whole
from ._version import __version__
from ._wire import default_socket

__all__ = [
    "Applied",
    "Armed",
    "AsyncArmed",
    "AsyncGateway",
    "BusEvent",
    "Configured",
    "ConfiguredEntry",
    "Confirmed",
    "ConnectionLost",
    "DisconnectedEvent",
    "EstopEvent",
    "Event",
    "FaultEvent",
    "ForceEvent",
    "Frame",
    "FrameEvent",
    "Gateway",
    "GatewayUnavailable",
    "Hello",
    "HelloEvent",
    "IWheelError",
    "LeaseEnded",
    "LeaseEvent",
    "LedgerEntry",
    "LedgerEvent",
    "LostEvent",
    "NoAnswer",
    "OffsetEvent",
    "OnRequest",
    "OnStatus",
    "Piece",
    "ProtocolError",
    "ReconnectedEvent",
    "RecordedEvent",
    "Recording",
    "RecordingEntry",
    "RecordingError",
    "Recordings",
    "Refused",
    "RollingEvent",
    "Sample",
    "StateEvent",
    "Status",
    "Stop",
    "StopEvent",
    "StopSummary",
    "Tared",
    "Terms",
    "Watched",
    "WheelSample",
    "WheelStatus",
    "Whole",
    "__version__",
    "default_socket",
    "read_recording",
]
