# SPDX-License-Identifier: MIT
"""Types that this package returns, in addition to those of _protocol.py. docs/user/northbound.md describes them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, SupportsIndex, TypedDict
from collections.abc import Callable

from ._protocol import (
    BusEvent,
    EstopEvent,
    FaultEvent,
    ForceEvent,
    FrameEvent,
    HelloEvent,
    LeaseEvent,
    LedgerEvent,
    LostEvent,
    OffsetEvent,
    RollingEvent,
    StateEvent,
    Status,
    StopEvent,
)


class DisconnectedEvent(TypedDict):
    """This package reports that the connection was lost."""

    event: Literal["disconnected"]
    message: str


class ReconnectedEvent(TypedDict):
    """This package reports that the gateway is back, with the same subscription."""

    event: Literal["reconnected"]


Event = (
    BusEvent
    | DisconnectedEvent
    | EstopEvent
    | FaultEvent
    | ForceEvent
    | FrameEvent
    | HelloEvent
    | LeaseEvent
    | LedgerEvent
    | LostEvent
    | OffsetEvent
    | ReconnectedEvent
    | RollingEvent
    | StateEvent
    | StopEvent
)
"""An event as received: `event` is its name. After `if event["event"] == "state":` type checkers know its fields. Ignore unknown names and fields."""

Whole = SupportsIndex | float
"""A whole number of any type: 200, 200.0, numpy.int64(200). The call that uses it refuses 200.5, True and NaN."""

OnStatus = Callable[[Status], object]
"""Function that `drive_for` calls with each snapshot. If it returns True, the drive ends; `drive_for` ignores all other results."""


@dataclass(frozen=True)
class Applied:
    """Target after limits. Ramps lead to it."""

    left_mm_s: int
    right_mm_s: int
    left_mA: int
    right_mA: int
    limited: bool
    """The target differs from the request: the gateway scaled both wheels by one factor."""


@dataclass(frozen=True)
class Terms:
    """Terms of a granted `arm`."""

    lease_ms: int
    """Each accepted command is valid for this time."""
    first_lease_ms: int
    """The first command must come within this time."""
    stop_budget_ms: int
    """Longest time of motion after the last command."""
    stop_budget_mm: int
    """Longest distance of motion after the last command."""
    warnings: tuple[str, ...]
    key: str | None = field(default=None, repr=False)
    """Secret of this lease; None: the gateway is a microcontroller, which has none."""
