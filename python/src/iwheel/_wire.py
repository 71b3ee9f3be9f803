# SPDX-License-Identifier: MIT
"""The northbound protocol without I/O: converts requests to bytes, and bytes to replies and events. Both clients use it."""

from __future__ import annotations

import base64
import binascii
import errno
import json
import math
import numbers
import operator
import os
import socket
import zlib
from typing import Any, cast
from collections.abc import Iterable, Mapping

from ._errors import ConnectionLost, GatewayUnavailable, LeaseEnded, ProtocolError, Refused
from ._protocol import API, LINE_MAX, REQUEST_MAX, Piece
from ._types import Applied, Event, Terms
from ._version import __version__

DEFAULT_FOLDER = "/run/iwheel"
WATCH_FOLDER = "watch"
"""Subdirectory of DEFAULT_FOLDER with the watch sockets, each with the name of the drive socket."""
HARMLESS = ("out_of_range", "bad_value", "missing_field", "unknown_field", "bad_json")
"""Refusals of a drive command that do not end the permission to drive."""
PASSING = ("not_at_rest", "stale_command")
"""Refusals of `arm` that end on their own: when the wheels are at standstill, or the last drive command is half a second old. A refusal as
`stale_command` whose message names `t_us` does not end: see ArmTime."""
REPEATABLE = ("hello", "status", "why", "recordings", "recording")
"""Requests that are repeated on a new connection if the old one broke. They never start a motion."""
REST_S = 3.0
"""Longest wait for standstill at the end of driving."""
ARM_S = 2.0
"""Time for which `arm` repeats its request after a recent stop."""
ARM_AGAIN_S = 0.05
STOPPED_MEANWHILE = "the wheels were stopped while it was requested"
RATE_MAX_HZ = 100
REASON_BYTES = 200
"""Longest `reason` of an estop."""
DISTINCTIONS = {"fault": ("cause",), "offset": ("side",), "ledger": ("item",), "frame": ("id", "kind")}
"""Fields that must be equal for one event to supersede another of the same name."""

Message = dict[str, Any]
NoneType = type(None)


def default_socket() -> str:
    """Returns $IWHEEL_SOCKET, or the socket of the only gateway in /run/iwheel. Sockets that a killed gateway has left do not count.

    Raises GatewayUnavailable with the fix if several gateways run."""
    sockets = default_sockets()
    if len(sockets) > 1:
        sockets = [path for path in sockets if not is_left_over(path)] or sockets[:1]
    if len(sockets) > 1:
        names = ", ".join(map(os.path.basename, sockets))
        raise GatewayUnavailable(f"several gateways run: {names} in {DEFAULT_FOLDER}; name the socket of one")
    return sockets[0]


def default_sockets() -> list[str]:
    """Returns $IWHEEL_SOCKET, or of each gateway in /run/iwheel the drive socket, or the watch socket if only that may be used. Never empty."""
    named = os.environ.get("IWHEEL_SOCKET")
    if named:
        return [named]
    watch_folder = os.path.join(DEFAULT_FOLDER, WATCH_FOLDER)
    names = sorted(sockets_in(DEFAULT_FOLDER) | sockets_in(watch_folder)) or ["gateway.sock"]
    both = [(os.path.join(DEFAULT_FOLDER, name), os.path.join(watch_folder, name)) for name in names]
    return [watch if may_use(watch) and not may_use(drive) else drive for drive, watch in both]


def is_left_over(path: str) -> bool:
    """Returns True if no program listens at that socket any more."""
    with socket.socket(socket.AF_UNIX) as one:
        one.setblocking(False)
        return one.connect_ex(path) == errno.ECONNREFUSED


def sockets_in(folder: str) -> set[str]:
    try:
        return {name for name in os.listdir(folder) if name.endswith(".sock")}
    except OSError:
        return set()


def may_use(path: str) -> bool:
    return os.access(path, os.W_OK, effective_ids=os.access in os.supports_effective_ids)


def cannot_connect(path: str, error: OSError) -> GatewayUnavailable:
    """Returns the error with its fix."""
    if isinstance(error, PermissionError):
        remedy = "this user may not use it; join its group (usermod -aG iwheel USER), then log in again"
    elif isinstance(error, (FileNotFoundError, ConnectionRefusedError)):
        remedy = "no gateway listens there; start it, or name another socket"
    else:
        remedy = str(error)
    return GatewayUnavailable(f"{path}: {remedy}")


class Wire:
    """Protocol state of one connection: numbers requests, and splits the stream into messages."""

    def __init__(self) -> None:
        self._number = 0
        self._pending = bytearray()

    def request(self, cmd: str, fields: Mapping[str, Any]) -> tuple[int, bytes]:
        """Returns the request's number and its bytes. Omits fields that are None."""
        self._number += 1
        body = {"cmd": cmd, "id": self._number, **{k: v for k, v in fields.items() if v is not None}}
        line = json.dumps(body, allow_nan=False).encode() + b"\n"
        if len(line) - 1 > REQUEST_MAX:
            raise ValueError(f"{cmd}: a request has at most {REQUEST_MAX} bytes, this one {len(line) - 1}")
        return self._number, line

    def feed(self, data: bytes) -> list[Message]:
        """Returns all messages that are now complete. Raises ProtocolError if the data is not of the northbound protocol."""
        self._pending += data
        *lines, rest = self._pending.split(b"\n")
        self._pending = bytearray(rest)
        if len(rest) > LINE_MAX:
            raise ProtocolError(f"a line of more than {LINE_MAX} bytes came; is this the socket of an iwheel-gateway?")
        return [self._parse(bytes(line)) for line in lines]

    @staticmethod
    def _parse(line: bytes) -> Message:
        try:
            message = json.loads(line)
        except (ValueError, RecursionError) as error:
            raise ProtocolError(f"not JSON: {line[:60]!r}; is this the socket of an iwheel-gateway?") from error
        if not isinstance(message, dict) or ("ok" in message) == ("event" in message) or not named(message):
            raise ProtocolError(f"neither reply nor event: {line[:60]!r}; is this the socket of an iwheel-gateway?")
        return message


def named(message: Message) -> bool:
    """Returns True if the number of a reply, or the name of an event, has a valid type."""
    return isinstance(message["event"], str) if "event" in message else isinstance(message.get("id"), (int, NoneType))


def result_of(cmd: str, reply: Message) -> Message:
    """Returns the reply, or raises Refused."""
    if reply["ok"] is not True:
        raise Refused(cmd, str(reply.get("error")), str(reply.get("message")))
    return reply


class ArmTime:
    """`t_us` of an `arm` that is repeated, so that the gateway refuses the next attempt after a stop of any client in the meantime.

    The time of the first attempt would become older than the gateway's limit. A refusal as `not_at_rest` moves it to the time at which the
    refused attempt began: the gateway judges `t_us` first, so there was no stop until then. No other refusal moves it.
    """

    def __init__(self, status: Message) -> None:
        self.t_us: int | None = fields_of("status", status, ["t_us"])["t_us"]
        self._begun_us = self.t_us
        self._earlier: Refused | None = None

    def begin(self, status: Message) -> None:
        """Begins the next attempt. `status` was requested for it, after the refusal of the last one."""
        self._begun_us = fields_of("status", status, ["t_us"])["t_us"]

    def is_unknown(self, refusal: Refused) -> bool:
        """Returns True once if the gateway, older than 0.3, does not know `t_us`: then one attempt without it, and no other."""
        unknown = refusal.error == "unknown_field" and self.t_us is not None
        if unknown:
            self.t_us = None
        return unknown

    def refused(self, refusal: Refused) -> bool:
        """Notes the refusal of this attempt. Returns True if another attempt can be granted."""
        passing = self.t_us is not None and refusal.error in PASSING and "t_us" not in refusal.message
        if passing:
            self._earlier = refusal
        if refusal.error == "not_at_rest":
            self.t_us = self._begun_us
        return passing

    def reason(self, refusal: Refused) -> Refused:
        """Returns the refusal that ends the wait, with the reason of the wait."""
        earlier = self._earlier
        if earlier is None or earlier is refusal:
            return refusal
        return Refused(refusal.cmd, refusal.error, f"{refusal.message} (it was refused before, because {earlier.message})")


def integer(name: str, value: object) -> int:
    """Returns an int from an int or an equal value of another type: numpy integers, 200.0. Otherwise raises ValueError or TypeError."""
    if isinstance(value, bool):
        raise TypeError(f"{name} must be a whole number, not {value}")
    number = cast(Any, value)
    try:
        return operator.index(number)
    except TypeError:
        pass
    if not isinstance(value, numbers.Real):
        raise TypeError(f"{name} must be a whole number, not {value!r} ({type(value).__name__})")
    if not math.isfinite(number):
        raise ValueError(f"{name} must be a whole number, not {value!s}; is its source unknown?")
    whole = int(number)
    if whole != number:
        raise ValueError(f"{name} must be a whole number, as on the bus, not {value!s}; round it: round(x)")
    return whole


def integers(**values: object) -> Message:
    """Converts fields of a request. `Wire.request` omits None."""
    return {name: None if value is None else integer(name, value) for name, value in values.items()}


def seconds_of(value: float) -> float:
    """Checks a time of driving. Infinite means without limit."""
    if not value >= 0:
        raise ValueError(f"seconds must be a number of at least 0, not {value}")
    return value


def period_of(terms: Terms, rate_hz: float | None) -> float:
    """Returns the seconds between two commands: three per lease, or more if `rate_hz` requests it."""
    if rate_hz is not None and not 0 < rate_hz <= RATE_MAX_HZ:
        raise ValueError(f"rate_hz must be a number above 0 and at most {RATE_MAX_HZ}, not {rate_hz}")
    return min(terms.lease_ms / 3000, 1 / rate_hz if rate_hz is not None else math.inf)


def reason_of(reason: object) -> str | None:
    """Returns the reason of an estop as a text that the gateway accepts: no reason may prevent the stop."""
    try:
        text = "" if reason is None else str(reason)[: 10 * REASON_BYTES]
    except Exception as error:  # noqa: BLE001 (it is the program's own code)
        text = f"{type(reason).__name__} (its text failed: {type(error).__name__})"
    words = "".join(character if character.isprintable() else " " for character in text).split()
    return " ".join(words).encode()[:REASON_BYTES].decode(errors="ignore").rstrip() or None


def ended_by(refusal: Refused) -> LeaseEnded:
    return LeaseEnded(f"this permission to drive is over: {refusal.message}", refusal.error)


def lost_with(error: GatewayUnavailable) -> ConnectionLost:
    return ConnectionLost(f"{error}; this permission to drive is over, arm again")


def check_api(path: str, hello: Message) -> None:
    """Raises ProtocolError for a newer protocol: the same words may have another meaning there, so this package must not drive."""
    api = hello.get("api", API)
    if not isinstance(api, int) or api > API:
        raise ProtocolError(
            f"{path}: this gateway (version {hello.get('version')}) has the northbound protocol {api}, this Python package "
            f"iwheel {__version__} supports it up to {API}; install the package of the gateway's version"
        )


def applied_of(reply: Message) -> Applied:
    return Applied(**fields_of("drive", reply, Applied.__dataclass_fields__))


def terms_of(reply: Message) -> Terms:
    named = [name for name in Terms.__dataclass_fields__ if name != "key"]
    values = fields_of("arm", reply, named)
    values["warnings"] = tuple(values["warnings"] or ())
    values["key"] = reply.get("key")
    return Terms(**values)


def fields_of(cmd: str, reply: Message, names: Iterable[str]) -> Message:
    missing = [name for name in names if name not in reply]
    if missing:
        raise ProtocolError(f"the reply to {cmd} has no {missing[0]}; is this the socket of an iwheel-gateway?")
    return {name: reply[name] for name in names}


def without_envelope(reply: Message) -> Any:
    """Returns the reply without `id` and `ok`."""
    return {name: value for name, value in reply.items() if name not in ("id", "ok")}


def add_piece(data: bytearray, piece: Piece) -> bool:
    """Appends a piece of a recording. Returns True after the last one. Raises ProtocolError if a checksum is wrong."""
    try:
        more = base64.b64decode(piece["data"], validate=True)
    except binascii.Error as error:
        raise ProtocolError(f"{piece['name']}: a piece is not base64: {error}") from error
    if piece["offset"] != len(data) or zlib.crc32(more) != piece["crc32"]:
        raise ProtocolError(f"{piece['name']}: the piece at {len(data)} is damaged; request the recording again")
    data += more
    if len(data) < piece["size"] and more:
        return False
    if len(data) != piece["size"] or zlib.crc32(data) != piece["file_crc32"]:
        raise ProtocolError(f"{piece['name']}: the checksum of the whole file is wrong; request the recording again")
    return True


def lost_event(count: int) -> Event:
    """Returns the event with which the gateway reports lost events; here for events that the program did not read in time."""
    return {"event": "lost", "count": count}


def newest(events: Iterable[Event]) -> tuple[list[Event], int]:
    """Returns only the newest event of each kind, and the number of dropped ones, including those that the gateway reports (`lost`)."""
    retained: dict[tuple[str, ...], Event] = {}
    left_out = 0
    for event in events:
        if event["event"] == "lost":
            left_out += event["count"]
            continue
        name = event["event"]
        thing = (name, *(str(cast(Message, event).get(field)) for field in DISTINCTIONS.get(name, ())))
        left_out += retained.pop(thing, None) is not None
        retained[thing] = event
    return list(retained.values()), left_out


def at_standstill(status: Message) -> bool:
    """Returns True if no speed is commanded and both wheels are known to be at standstill."""
    wheels = [cast(Message, status[side]) for side in ("left", "right")]
    return all(wheel["at_rest"] is True and not wheel["applied_mm_s"] for wheel in wheels)
