# SPDX-License-Identifier: MIT
"""Types of the gateway's replies and events. Written by scripts/northbound.py from share/northbound.json; None means unknown."""

from __future__ import annotations

from typing import Literal, TypedDict

API = 1
REQUEST_MAX = 4096
LINE_MAX = 65536

State = Literal["listening", "armed", "stopping", "latched"]

Rights = Literal["drive", "watch"]


class Hello(TypedDict):
    """Who answers."""

    name: str
    """iwheel-gateway"""
    version: str
    """of the gateway"""
    api: int
    """of this protocol; grows when a client of before would be misled"""
    bus: str
    """the interface"""
    state: State
    client: int
    """of this connection; no other one ever gets it"""
    rights: Rights
    """of this connection, by its socket"""


Cause = Literal[
    "estop_line",
    "estop_disagrees",
    "estop_software",
    "wheel_lost",
    "wheel_rebooted",
    "send_stalled",
    "bus_down",
    "second_master",
    "feedback_sign",
    "overspeed",
    "loop_hung",
    "internal",
    "loop_late",
    "wheel_blocked",
    "pair_diverges",
    "lease_lost",
    "client_gone",
    "client_stop",
    "shutdown",
    "restart",
]


class LeaseStatus(TypedDict):
    """Who may drive. All None if nobody may, but lease_ms."""

    holder: int | None
    """of the client"""
    name: str | None
    """that it gave itself"""
    pid: int | None
    """of its process"""
    remaining_ms: int | None
    lease_ms: int
    """as configured"""


BusState = Literal["down", "bus_off", "passive", "active"]

Timing = Literal["unproven", "confirmed", "near", "contradicted"]

Echo = Literal["proven", "unproven"]


class BusStatus(TypedDict):
    name: str
    state: BusState
    timing: Timing
    echo: Echo
    bitrate: int | None
    sample_point_permille: int | None
    load_permille: int | None
    """of the last second, without stuff bits"""
    lost_frames: int | None
    """that came faster than they were read"""


EstopState = Literal["released", "pressed", "unreadable", "disagrees", "none"]

EstopContact = Literal["neither", "line", "line2", "both"]


class _EstopStatusPartly(TypedDict, total=False):
    line2: str
    pressed_at: EstopContact


class EstopStatus(_EstopStatusPartly):
    line: str
    state: EstopState
    simulated: bool
    tried_wall_us: int | None
    """when its button was last seen pressed and released on this wiring; None: never"""


class WheelValid(TypedDict):
    speed: bool
    status: bool
    temperature: bool
    cpu: bool
    force: bool


class WheelSaturated(TypedDict):
    battery: bool
    """255: at least 25.5 V"""
    force: bool


ForceValidity = Literal["valid", "not_heard", "saturated", "no_offset", "unit_contradicted", "offset_removed", "offset_doubted"]

Provenance = Literal["none", "stored", "estimated", "wheel", "operator"]

Origin = Literal["estimated", "wheel", "operator"]

Window = Literal["open", "good", "moving", "noisy", "drift", "loaded", "saturated"]

UnitEvidence = Literal["unknown", "cN", "dN", "offset_removed", "unclear"]


class WheelStatus(TypedDict):
    """One wheel. Speeds in mm/s are in the machine's sense, rpm and ticks in the wheel's own."""

    heard: bool
    """its speed, within wheel_silent_ms"""
    at_rest: bool | None
    """for rest_ms; None while not heard"""
    speed_rpm: int | None
    speed_mm_s: int | None
    acceleration_raw: int | None
    commanded_mm_s: int | None
    """what the client wants; None if nothing is wanted"""
    commanded_mA: int | None
    applied_mm_s: int | None
    """what the wheel was told last; None in silence"""
    applied_mA: int | None
    speed_age_ms: int | None
    """None: never"""
    battery_dV: int | None
    temperature_degC: int | None
    cpu_percent: int | None
    ticks: int | None
    """64 bits, unwrapped"""
    distance_mm: int | None
    status_age_ms: int | None
    reboots: int
    """seen since the gateway started"""
    valid: WheelValid
    saturated: WheelSaturated
    force_raw: int | None
    force_raw_mN: int | None
    force_offset_mN: int | None
    force_net_mN: int | None
    """None unless force_validity is valid"""
    force_validity: ForceValidity
    force_age_ms: int | None
    offset_provenance: Provenance
    """where the zero in force comes from"""
    offset_origin: Origin | None
    """what it was when it was taken, also if it is stored now"""
    offset_age_ms: int | None
    offset_contaminated: bool | None
    """it, or the attempt at one, was taken while the wheel turned, or under load or unrest; None: nobody saw"""
    offset_window: Window
    """the two seconds after the wheel's start, or after ours"""
    offset_samples: int | None
    offset_deviation_mN: int | None
    offset_drift_mN: int | None
    wheel_offset_mN: int | None
    """the wheel's own, in force or not; None: not heard since its start"""
    unit_evidence: UnitEvidence


class Pose(TypedDict):
    """As the right wheel sends it."""

    x_mm: int | None
    y_mm: int | None
    z_mm: int | None
    psi_mrad: int | None
    limited: bool
    """a coordinate stands at the end of its range"""
    age_ms: int | None


LedgerState = Literal["assumed", "confirmed", "contradicted"]

Evidence = Literal["none", "document", "configuration", "bus", "operator"]


class LedgerEntry(TypedDict):
    """An assumption, and what is known of it."""

    state: LedgerState
    evidence: Evidence
    figure: int | None
    """measured, by the bus only"""
    value: str | None
    """in force"""
    found: str | None
    """by the operator, if told"""
    how: str | None
    """by what it was found, if told"""
    since_wall_us: int | None
    reason: str
    """the evidence in words"""
    disabled: str | None
    """by a contradiction: what, and the cure"""


LedgerItem = Literal[
    "setpoint_type",
    "current_role",
    "force_unit_left",
    "force_unit_right",
    "offset_included",
    "feedback_sign_left",
    "feedback_sign_right",
    "mount_sign_left",
    "mount_sign_right",
    "wheel_radius",
    "track",
    "gear_ratio",
    "pose_byte_order",
    "dlc",
]

MemoryState = Literal["loading", "new", "kept", "ignored", "failed"]


class Memory(TypedDict):
    """Where what is known of the wheels is kept."""

    file: str
    state: MemoryState
    reason: str | None
    """of ignored and failed"""


class Gaps(TypedDict):
    """Between setpoint pairs since the gateway's start, while they are sent."""

    limits_ms: list[int]
    """upper bounds of all buckets but the last"""
    count: list[int]
    """per bucket"""
    worst_us: int | None


class Budget(TypedDict):
    """How long and how far the machine goes on at most."""

    client_lost_ms: int
    client_lost_mm: int
    killed_ms: int
    killed_mm: int


class Pair(TypedDict):
    """How far the pair is from its commanded path, right wheel against left, in mm of the wheels' firmware (radius 192). What is ordinary does not count."""

    deviation_mm: int
    """now; positive: it turns to the left of its path"""
    largest_mm: int
    """of this drive, or of the last one, either way"""
    limit_mm: int
    """pair_mm: there it stops"""


class Counters(TypedDict):
    """Of the bus and the loop, since the gateway's start."""

    received: int
    echoes: int
    bad_format: int
    bad_length: int
    unknown: int
    foreign: int
    late_steps: int
    out_of_range: int
    purges: int
    left_behind: int
    """times that a setpoint stayed in the controller"""
    pairs: int
    send_later: int
    clamped: int
    gate_stopped: int
    stray_echoes: int
    gap_max_us: int
    still_moving: int


class Status(TypedDict):
    """One complete snapshot: the reply to `status`, and the event `state`."""

    t_us: int
    """CLOCK_MONOTONIC; never steps"""
    wall_us: int
    """CLOCK_REALTIME since 1970; may step"""
    version: str
    state: State
    arming: bool
    """a zero pair was sent and is not proven yet"""
    cause: Cause | None
    """why stopping or latched"""
    present: list[Cause]
    """what keeps arm or reset from succeeding now"""
    lease: LeaseStatus
    bus: BusStatus
    estop: EstopStatus
    left: WheelStatus
    right: WheelStatus
    pose: Pose
    ledger: dict[LedgerItem, LedgerEntry]
    memory: Memory
    gaps: Gaps
    budget: Budget
    pair: Pair
    counters: Counters
    clients: int
    holding: bool
    """zeros are held without limit of time, until `release` or `arm` (key after_stop)"""
    rolling: bool
    """a wheel turns faster than 100 mm/s and nothing is sent to it"""
    listen_only: bool
    shutting_down: bool
    warnings: list[str]


Topic = Literal["state", "bus", "estop", "lease", "stop", "force", "frame"]


class Watched(TypedDict):
    """What was granted."""

    topics: list[Topic]
    rate_hz: int
    limited: bool
    """it is slower than what was asked"""


class TaredWheel(TypedDict):
    """The zero of one wheel after a tare, and before."""

    offset_mN: int
    samples: int
    deviation_mN: int
    drift_mN: int
    before_mN: int | None
    before_provenance: Provenance


class _TaredPartly(TypedDict, total=False):
    left: TaredWheel
    right: TaredWheel


class Tared(_TaredPartly):
    """The reply to `tare`; only the wheels that were asked for are there."""

    state: State


Sides = Literal["left", "right", "both"]

FrameKind = Literal["received", "echo"]

FrameFlag = Literal["extended", "remote", "fd"]


class Frame(TypedDict):
    """A frame on the bus."""

    t_us: int
    id: int
    dlc: int
    data: str
    """hexadecimal"""
    kind: FrameKind
    flags: list[FrameFlag]


_StopSummaryNamed = TypedDict("_StopSummaryNamed", {"from": State | None})


class StopSummary(_StopSummaryNamed):
    """A stop: the event `stop`, and part of the reply to `why`. `number` 0: there was none, and the others are None."""

    number: int
    """of the stop since the gateway's start"""
    cause: Cause | None
    side: Sides | None
    detail: int | None
    latched: bool
    client: int | None
    """who held the lease or asked for the stop"""
    client_name: str | None
    applied_left_mm_s: int | None
    applied_right_mm_s: int | None
    at_us: int | None
    wall_us: int | None
    """when the stop was seen"""
    age_ms: int | None
    sentence: str


class Stop(StopSummary):
    """The last stop: the reply to `why`."""

    directory: str
    """of the recordings"""
    recording: str | None
    """the file of this stop; None: not latched, or not written yet"""
    recording_error: str | None
    """why it could not be written"""
    frames_before: list[Frame]
    """up to 40"""
    frames_after: list[Frame]
    """up to 40"""


class Confirmed(LedgerEntry):
    """The reply to `confirm`: the item and its entry. `value` is what is configured."""

    item: LedgerItem


class RecordingEntry(TypedDict):
    """A recording on disk: three files with one name and an ending each."""

    name: str
    """of its files, without .log, .jsonl or .conf"""
    cause: str
    """a cause, gateway_died or rolling"""
    wall_us: int | None
    """when its .conf was written, at the stop"""
    log_bytes: int | None
    """None: there is no such file"""
    jsonl_bytes: int | None
    conf_bytes: int | None


class Recordings(TypedDict):
    """The reply to `recordings`."""

    recordings: list[RecordingEntry]
    """the oldest first; of more than 64 the newest"""


class Piece(TypedDict):
    """The reply to `recording`: some bytes of a file."""

    name: str
    """of the file"""
    offset: int
    """of the first byte in data"""
    size: int
    """of the file now; it may grow for two seconds after the stop"""
    data: str
    """base64 (RFC 4648): 24576 bytes, or what is left"""
    crc32: int
    """CRC-32 (as zlib's) of these bytes"""
    file_crc32: int | None
    """of the whole file; None unless this is its last piece"""


class ConfiguredEntry(TypedDict):
    """A key of the configuration."""

    key: str
    """section.key, as in the configuration file"""
    value: str | None
    """as staged, else as in force; None: not set"""


class Configured(TypedDict):
    """The reply to `config`."""

    keys: list[ConfiguredEntry]
    """all there are"""
    staged: bool
    """something is staged and not committed"""
    restarts: bool
    """it was committed, and the gateway starts anew"""
