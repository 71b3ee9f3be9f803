# SPDX-License-Identifier: MIT
"""What the gateway answers, as types. The meaning of every field is in docs/northbound.md."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Dict, List, Optional, TypedDict

Event = Dict[str, Any]
"""An event as it came: `event` is its name. Names and fields that are not known must be ignored."""


@dataclass(frozen=True)
class Applied:
    """The target after limits; ramps come on top."""

    left_mm_s: int
    right_mm_s: int
    left_mA: int
    right_mA: int
    limited: bool
    """It differs from what was asked: both wheels were scaled by one factor."""


@dataclass(frozen=True)
class Terms:
    """What `arm` was answered with."""

    lease_ms: int
    """Each accepted command holds this long."""
    first_lease_ms: int
    """The first command must come this soon."""
    stop_budget_ms: int
    """How long the machine goes on at most after the last command ..."""
    stop_budget_mm: int
    """... and how far."""
    warnings: tuple[str, ...]


class LeaseStatus(TypedDict):
    holder: Optional[int]
    name: Optional[str]
    pid: Optional[int]
    remaining_ms: Optional[int]
    lease_ms: int


class BusStatus(TypedDict):
    name: str
    state: str
    timing: str
    echo: str
    bitrate: Optional[int]
    sample_point_permille: Optional[int]
    load_permille: Optional[int]
    lost_frames: Optional[int]


class EstopStatus(TypedDict):
    line: str
    state: str
    simulated: bool


class WheelStatus(TypedDict):
    heard: bool
    at_rest: Optional[bool]
    speed_rpm: Optional[int]
    speed_mm_s: Optional[int]
    acceleration_raw: Optional[int]
    commanded_mm_s: Optional[int]
    commanded_mA: Optional[int]
    applied_mm_s: Optional[int]
    applied_mA: Optional[int]
    speed_age_ms: Optional[int]
    battery_dV: Optional[int]
    temperature_degC: Optional[int]
    cpu_percent: Optional[int]
    ticks: Optional[int]
    distance_mm: Optional[int]
    status_age_ms: Optional[int]
    reboots: int
    valid: Dict[str, bool]
    saturated: Dict[str, bool]
    force_raw: Optional[int]
    force_raw_mN: Optional[int]
    force_offset_mN: Optional[int]
    force_net_mN: Optional[int]
    force_validity: str
    force_age_ms: Optional[int]
    offset_provenance: str
    offset_age_ms: Optional[int]
    offset_window: str
    offset_samples: Optional[int]
    offset_deviation_mN: Optional[int]
    offset_drift_mN: Optional[int]
    unit_evidence: str


class Status(TypedDict):
    """One complete snapshot: the reply to `status`, and the event `state`."""

    t_us: int
    wall_us: int
    version: str
    state: str
    arming: bool
    cause: Optional[str]
    present: List[str]
    lease: LeaseStatus
    bus: BusStatus
    estop: EstopStatus
    left: WheelStatus
    right: WheelStatus
    pose: Dict[str, Any]
    ledger: Dict[str, Any]
    budget: Dict[str, int]
    counters: Dict[str, int]
    clients: int
    listen_only: bool
    shutting_down: bool
    warnings: List[str]


class Stop(TypedDict):
    """The last stop: the reply to `why`, and the event `stop`. `number` 0: there was none, the others are None."""

    number: int
    cause: Optional[str]
    side: Optional[str]
    detail: Optional[int]
    latched: bool
    client: Optional[int]
    client_name: Optional[str]
    applied_left_mm_s: Optional[int]
    applied_right_mm_s: Optional[int]
    at_us: Optional[int]
    wall_us: Optional[int]
    age_ms: Optional[int]
    sentence: str
