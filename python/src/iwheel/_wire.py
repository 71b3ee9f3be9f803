# SPDX-License-Identifier: MIT
"""The northbound protocol without any I/O: requests to bytes, bytes to replies and events. Both clients are built on it."""

from __future__ import annotations

import json
import os
from typing import Any, Dict, List, Mapping, Optional, cast

from ._errors import GatewayUnavailable, ProtocolError, Refused
from ._types import Applied, Event, Terms

REQUEST_MAX = 4096
LINE_MAX = 65536
DEFAULT_FOLDER = "/run/iwheel"
HARMLESS = ("out_of_range", "bad_value", "missing_field", "unknown_field", "bad_json")
"""Refusals of a drive command that say nothing about the permission to drive."""

Message = Dict[str, Any]


def default_socket() -> str:
    """$IWHEEL_SOCKET, or the only socket in /run/iwheel. Several or none: GatewayUnavailable says what to do."""
    named = os.environ.get("IWHEEL_SOCKET")
    if named:
        return named
    try:
        names = sorted(name for name in os.listdir(DEFAULT_FOLDER) if name.endswith(".sock"))
    except OSError:
        names = []
    if len(names) > 1:
        raise GatewayUnavailable(f"several gateways run: {', '.join(names)} in {DEFAULT_FOLDER}; name the socket of one")
    return os.path.join(DEFAULT_FOLDER, names[0] if names else "gateway.sock")


def cannot_connect(path: str, error: OSError) -> GatewayUnavailable:
    """The error with its cure."""
    if isinstance(error, PermissionError):
        cure = "you may not use it; join its group (usermod -aG iwheel USER), then log in again"
    elif isinstance(error, (FileNotFoundError, ConnectionRefusedError)):
        cure = "no gateway listens there; start it, or name another socket"
    else:
        cure = str(error)
    return GatewayUnavailable(f"{path}: {cure}")


class Wire:
    """One connection's worth of protocol: numbers requests, cuts the stream into lines, keeps replies that came early."""

    def __init__(self) -> None:
        self._number = 0
        self._pending = bytearray()

    def request(self, cmd: str, fields: Mapping[str, Any]) -> tuple[int, bytes]:
        """The request's number and its bytes. Fields that are None are left out."""
        self._number += 1
        body = {"cmd": cmd, "id": self._number, **{k: v for k, v in fields.items() if v is not None}}
        line = json.dumps(body, allow_nan=False).encode() + b"\n"
        if len(line) - 1 > REQUEST_MAX:
            raise ValueError(f"{cmd}: a request has at most {REQUEST_MAX} bytes, this one {len(line) - 1}")
        return self._number, line

    def feed(self, data: bytes) -> List[Message]:
        """All messages that are complete now. ProtocolError if that is no northbound protocol."""
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
        except ValueError as error:
            raise ProtocolError(f"not JSON: {line[:60]!r}; is this the socket of an iwheel-gateway?") from error
        if not isinstance(message, dict) or ("ok" in message) == ("event" in message):
            raise ProtocolError(f"neither reply nor event: {line[:60]!r}; is this the socket of an iwheel-gateway?")
        return message


def result_of(cmd: str, reply: Message) -> Message:
    """The reply's fields, or Refused."""
    if reply["ok"] is not True:
        raise Refused(cmd, str(reply.get("error")), str(reply.get("message")))
    return reply


def drive_fields(left_mm_s: int, right_mm_s: int, left_mA: Optional[int], right_mA: Optional[int]) -> Message:
    return {"left_mm_s": left_mm_s, "right_mm_s": right_mm_s, "left_mA": left_mA, "right_mA": right_mA}


def applied_of(reply: Message) -> Applied:
    return Applied(**{name: reply[name] for name in Applied.__dataclass_fields__})


def terms_of(reply: Message) -> Terms:
    values = {name: reply[name] for name in Terms.__dataclass_fields__}
    values["warnings"] = tuple(values["warnings"])
    return Terms(**values)


def without_envelope(reply: Message) -> Any:
    """The reply without `id` and `ok`."""
    return {name: value for name, value in reply.items() if name not in ("id", "ok")}


def lost_event(count: int) -> Event:
    """What the gateway tells a slow reader, told by ourselves: events that were not taken in time."""
    return {"event": "lost", "count": count}


def stands(status: Message) -> bool:
    """Nothing is commanded any more and both wheels are known to be at rest."""
    wheels = [cast(Message, status[side]) for side in ("left", "right")]
    return all(wheel["at_rest"] is True and not wheel["applied_mm_s"] for wheel in wheels)
