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
    """Data of the gateway and this connection."""

    name: str
    """iwheel-gateway"""
    version: str
    """version of the gateway"""
    api: int
    """version of this protocol; increases if an older client would misunderstand it"""
    bus: str
    """name of the interface"""
    state: State
    client: int
    """number of this connection; never used again"""
    rights: Rights
    """rights of this connection, which depend on its socket"""


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
    """The lease. All fields except lease_ms are None if it is free."""

    holder: int | None
    """number of the client"""
    name: str | None
    """name from its arm request"""
    pid: int | None
    """id of its process"""
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
    """load in the last second, without stuff bits"""
    lost_frames: int | None
    """frames that came faster than the gateway could read"""


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
    """last time at which the button was pressed and released on this wiring; None: never"""


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
    """online: a speed frame came within wheel_silent_ms"""
    at_rest: bool | None
    """at standstill for rest_ms; None while offline"""
    speed_rpm: int | None
    speed_mm_s: int | None
    acceleration_raw: int | None
    commanded_mm_s: int | None
    """speed that the client commands; None if none does"""
    commanded_mA: int | None
    applied_mm_s: int | None
    """speed in the last setpoint; None if the gateway sends none"""
    applied_mA: int | None
    speed_age_ms: int | None
    """None: never"""
    battery_dV: int | None
    temperature_degC: int | None
    cpu_percent: int | None
    ticks: int | None
    """without the wrap-around of the frame, 64 bits"""
    distance_mm: int | None
    status_age_ms: int | None
    reboots: int
    """reboots since the gateway started"""
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
    """source of the zero in force"""
    offset_origin: Origin | None
    """source of the zero when it was measured, also if it is a stored one now"""
    offset_age_ms: int | None
    offset_contaminated: bool | None
    """the zero, or the attempt to measure one, was measured while the wheel turned, under load, or with an unsteady force; None: not known"""
    offset_window: Window
    """result of the two seconds after the start of the wheel or of the gateway"""
    offset_samples: int | None
    offset_deviation_mN: int | None
    offset_drift_mN: int | None
    wheel_offset_mN: int | None
    """the wheel's own offset, in force or not; None: not received since its start"""
    unit_evidence: UnitEvidence


class Pose(TypedDict):
    """The pose that the right wheel sends."""

    x_mm: int | None
    y_mm: int | None
    z_mm: int | None
    psi_mrad: int | None
    limited: bool
    """a coordinate is at the end of its range"""
    age_ms: int | None


LedgerState = Literal["assumed", "confirmed", "contradicted"]

Evidence = Literal["none", "document", "configuration", "bus", "operator"]


class LedgerEntry(TypedDict):
    """An assumption, and what supports it."""

    state: LedgerState
    evidence: Evidence
    figure: int | None
    """measured value; only for an observation of the bus"""
    value: str | None
    """value in force"""
    found: str | None
    """value that the operator found, if present"""
    how: str | None
    """method of the operator, if present"""
    since_wall_us: int | None
    reason: str
    """the observation as a text"""
    disabled: str | None
    """functions that a contradiction disables, and the fix"""


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
    """The assumption store: the file with observations of the wheels."""

    file: str
    state: MemoryState
    reason: str | None
    """reason of ignored and failed"""


class Gaps(TypedDict):
    """Intervals between setpoint pairs since the gateway's start, while it sends them."""

    limits_ms: list[int]
    """upper limits of all buckets except the last"""
    count: list[int]
    """number of intervals in each bucket"""
    worst_us: int | None


class Budget(TypedDict):
    """Longest time and distance of motion after a client is lost, or after the gateway is killed."""

    client_lost_ms: int
    client_lost_mm: int
    killed_ms: int
    killed_mm: int


class Pair(TypedDict):
    """Deviation of the pair from its commanded path, right wheel against left, in mm of the wheels' firmware (radius 192). Ordinary deviations do not count."""

    deviation_mm: int
    """present deviation; positive: the machine turns to the left of its path"""
    largest_mm: int
    """largest deviation of this or the last drive, to either side"""
    limit_mm: int
    """pair_mm: deviation at which the gateway stops"""


class Counters(TypedDict):
    """Counters of the bus and the loop since the gateway's start."""

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
    """how often a setpoint stayed in the controller"""
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
    """cause of stopping or latched"""
    present: list[Cause]
    """causes for which arm or reset fails now"""
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
    """the gateway sends zeros without limit of time, until `release` or `arm` (key after_stop)"""
    rolling: bool
    """a wheel turns faster than 100 mm/s although the gateway sends nothing to it"""
    listen_only: bool
    shutting_down: bool
    warnings: list[str]


Topic = Literal["state", "bus", "estop", "lease", "stop", "force", "frame"]


class Watched(TypedDict):
    """The accepted subscription."""

    topics: list[Topic]
    rate_hz: int
    limited: bool
    """it is less than the request"""


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
    """The reply to `tare`, with the requested wheels only."""

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
    """A stop: the event `stop`, and part of the reply to `why`. `number` 0: there was no stop, and the other fields are None."""

    number: int
    """number of the stop since the gateway's start"""
    cause: Cause | None
    side: Sides | None
    detail: int | None
    latched: bool
    client: int | None
    """client that held the lease or requested the stop"""
    client_name: str | None
    applied_left_mm_s: int | None
    applied_right_mm_s: int | None
    at_us: int | None
    wall_us: int | None
    """time of the stop"""
    age_ms: int | None
    sentence: str


class Stop(StopSummary):
    """The last stop: the reply to `why`."""

    directory: str
    """directory of the recordings"""
    recording: str | None
    """the file of this stop; None: not latched, or not written yet"""
    recording_error: str | None
    """why the file could not be written"""
    frames_before: list[Frame]
    """up to 40"""
    frames_after: list[Frame]
    """up to 40"""


class Confirmed(LedgerEntry):
    """The reply to `confirm`: the item and its entry. `value` is the configured value."""

    item: LedgerItem


class RecordingEntry(TypedDict):
    """A recording on disk: three files with the same name and different endings."""

    name: str
    """name of its files, without .log, .jsonl or .conf"""
    cause: str
    """a cause, gateway_died, rolling or requested"""
    wall_us: int | None
    """time at which its .conf was written, at the stop"""
    log_bytes: int | None
    """None: there is no such file"""
    jsonl_bytes: int | None
    conf_bytes: int | None


RecordingEnd = Literal["request", "time", "size", "fault"]


class OnRequest(TypedDict):
    """The recording on request: the reply to `record`, and a part of the reply to `recordings`."""

    on: bool
    """it is being written, or begins"""
    name: str | None
    """name of the last one's files without suffix; None: there is none yet"""
    ended: RecordingEnd | None
    """reason for its end; None: not known, or it has not ended"""
    fault: str | None
    """the fault of the disk or of the process that writes, with ended fault"""
    most_ms: int
    """it ends after this time"""
    most_bytes: int
    """it ends at this size of its files"""


class Recordings(TypedDict):
    """The reply to `recordings`."""

    recordings: list[RecordingEntry]
    """oldest first; if there are more than 64, only the newest"""
    on_request: OnRequest
    """state of the recording on request"""


class Piece(TypedDict):
    """The reply to `recording`: a piece of a file."""

    name: str
    """name of the file"""
    offset: int
    """offset of the first byte in data"""
    size: int
    """present size of the file; it may grow for two seconds after the stop"""
    data: str
    """base64 (RFC 4648) of 24576 bytes, or of the rest of the file"""
    crc32: int
    """CRC-32 (as zlib's) of these bytes"""
    file_crc32: int | None
    """CRC-32 of the whole file; None unless this is its last piece"""


class ConfiguredEntry(TypedDict):
    """A key of the configuration."""

    key: str
    """section.key, as in the configuration file"""
    value: str | None
    """staged value, or else the value in force; None: not set"""


class Configured(TypedDict):
    """The reply to `config`."""

    keys: list[ConfiguredEntry]
    """all keys"""
    staged: bool
    """a value is staged and not committed"""
    restarts: bool
    """the values were committed, and the gateway restarts"""


class HelloEvent(Hello):
    """The event `hello`: on connect"""

    event: Literal["hello"]
    t_us: int


class StateEvent(Status):
    """The event `state`: at rate_hz, and immediately when the state changes"""

    event: Literal["state"]


class LedgerEvent(Confirmed):
    """The event `ledger`: an assumption is confirmed or contradicted"""

    event: Literal["ledger"]
    t_us: int


class BusEvent(TypedDict):
    """The event `bus`: state of the bus changes"""

    event: Literal["bus"]
    t_us: int
    state: BusState


class _EstopEventPartly(TypedDict, total=False):
    pressed_at: EstopContact


class EstopEvent(_EstopEventPartly):
    """The event `estop`: the line changes"""

    event: Literal["estop"]
    t_us: int
    state: EstopState


Change = Literal["gained", "moved", "lost"]


class LeaseEvent(TypedDict):
    """The event `lease`: the lease is gained, moved or lost"""

    event: Literal["lease"]
    t_us: int
    change: Change
    holder: int | None
    name: str | None
    former: int | None


class StopEvent(StopSummary):
    """The event `stop`: the wheels are stopped"""

    event: Literal["stop"]
    t_us: int


FaultAlone = Literal["still_moving", "zeros_ending", "battery_low", "temperature_high", "rolling", "setpoint_left"]


class FaultEvent(TypedDict):
    """The event `fault`: a cause comes or goes"""

    event: Literal["fault"]
    t_us: int
    cause: Cause | FaultAlone
    present: bool


class RollingEvent(TypedDict):
    """The event `rolling`: a wheel turns faster than 100 mm/s for 300 ms although the gateway sends nothing to it, or no longer: a person pushes the machine, or it rolls"""

    event: Literal["rolling"]
    t_us: int
    present: bool


class ForceView(TypedDict):
    """The force of one wheel, and its zero; the names are those of wheel_status."""

    raw: int | None
    raw_mN: int | None
    offset_mN: int | None
    net_mN: int | None
    validity: ForceValidity
    saturated: bool
    age_ms: int | None
    provenance: Provenance
    offset_age_ms: int | None
    contaminated: bool | None
    samples: int | None
    deviation_mN: int | None


class ForceEvent(TypedDict):
    """The event `force`: at rate_hz"""

    event: Literal["force"]
    t_us: int
    left: ForceView
    right: ForceView


Side = Literal["left", "right"]


class OffsetEvent(TypedDict):
    """The event `offset`: another zero is in force"""

    event: Literal["offset"]
    t_us: int
    side: Side
    offset_mN: int | None
    provenance: Provenance
    before_mN: int | None
    before_provenance: Provenance


class FrameEvent(Frame):
    """The event `frame`: each received frame, and each echo of the gateway's own frames"""

    event: Literal["frame"]


class LostEvent(TypedDict):
    """The event `lost`: a slow reader has lost events"""

    event: Literal["lost"]
    count: int
