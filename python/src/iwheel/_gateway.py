# SPDX-License-Identifier: MIT
"""The client for ordinary programs. Contract: see `Gateway` and `Armed`."""

from __future__ import annotations

import threading
import time
import warnings
from contextlib import contextmanager
from types import TracebackType
from typing import Any, cast
from collections.abc import Iterator

from ._connection import Connection
from ._errors import GatewayUnavailable, IWheelError, LeaseEnded, NoAnswer, ProtocolError, Refused
from ._protocol import Configured, Confirmed, Hello, Piece, RecordingEntry, State, Status, Stop, Tared, Watched
from ._stop import stop_by_either
from ._types import Applied, Event, OnStatus, Terms, Whole
from ._wire import (
    ALWAYS,
    ARM_AGAIN_S,
    ARM_S,
    HARMLESS,
    PASSING,
    REPEATABLE,
    REST_S,
    Message,
    add_piece,
    applied_of,
    check_api,
    default_socket,
    ended_by,
    integer,
    integers,
    lost_with,
    period_of,
    result_of,
    seconds_of,
    stands,
    terms_of,
    without_envelope,
)


class Gateway:
    """A connection to the gateway, made when it is first needed and again when it broke. Driving is never resumed.

    `socket`: else $IWHEEL_SOCKET, else the only gateway's in /run/iwheel that may be used. `timeout`: for each answer, in seconds. `wait`: how long to
    wait for a gateway that is not there (yet).

    One thread at a time: give each thread its own Gateway. `with` closes the connection at its end.
    """

    def __init__(self, socket: str | None = None, *, timeout: float = 1.0, wait: float = 0.0) -> None:
        self._path = socket
        self._timeout = timeout
        self._wait = wait
        self._connection: Connection | None = None
        self._subscription: Message | None = None
        self._busy = threading.RLock()
        self._kept = False

    def __enter__(self) -> Gateway:
        self._kept = True
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._kept = False
        self.close()

    def close(self) -> None:
        """Ends the connection, and with it the lease, if it was ours. The next request makes a new one."""
        connection, self._connection = self._connection, None
        if connection is not None:
            connection.close()

    # Reading: moves nothing ------------------------------------------------------------------------------------------

    def hello(self) -> Hello:
        """Who answers: `name version api bus state client rights`; `rights` is `drive` or `watch`, by the socket."""
        return cast(Hello, without_envelope(self._ask("hello")))

    def status(self) -> Status:
        """One complete snapshot."""
        return cast(Status, without_envelope(self._ask("status")))

    def why(self) -> Stop:
        """The last stop; `sentence` tells it in plain English."""
        return cast(Stop, without_envelope(self._ask("why")))

    def recordings(self) -> list[RecordingEntry]:
        """The recordings of stops on the gateway's disk, the oldest first: `name cause wall_us log_bytes jsonl_bytes conf_bytes`."""
        return cast(list[RecordingEntry], self._ask("recordings")["recordings"])

    def recording(self, name: str) -> bytes:
        """A file of one of them, whole and checked: `name` as `recordings` tells it, with .log, .jsonl or .conf behind it."""
        data = bytearray()
        while not add_piece(data, cast(Piece, self._ask("recording", name=name, offset=len(data)))):
            pass
        return bytes(data)

    def watch(self, *topics: str, rate_hz: Whole | None = None) -> Watched:
        """Subscribes to `state bus estop lease stop force frame`; replaces what was subscribed. Then read `events`.

        Returns what was granted: `topics rate_hz limited`.
        """
        fields = {"topics": list(topics), **integers(rate_hz=rate_hz)}
        granted = self._ask("watch", **fields)
        self._subscription = fields if topics else None
        return cast(Watched, without_envelope(granted))

    def events(self, timeout: float | None = None, *, latest: bool = False) -> Iterator[Event]:
        """Events as they come; ends when none came for `timeout` seconds (None: never ends).

        A lost connection is an event too: `disconnected`, then `reconnected` as soon as the gateway is back, with the same
        subscription. `lost` tells how many events were not read in time.

        `latest`: for who may be slow. Of each thing only the newest event that is there (`fault`, `offset`, `ledger` and `frame` differ by
        cause, side, item, id), instead of a backlog; before it `lost` tells how many were left out.
        """
        while True:
            event = self._next_event(timeout, latest)
            if event is None:
                return
            yield event

    # Stopping: always allowed ----------------------------------------------------------------------------------------

    def stop(self) -> State:
        """Ramp to zero, whoever drives. The state after that."""
        return cast(State, self._stop("stop")["state"])

    def estop(self, reason: str | None = None) -> State:
        """Zero without ramp, latched until `reset`. No substitute for the button that cuts power."""
        return cast(State, self._stop("estop", reason=reason)["state"])

    # What needs a decision -------------------------------------------------------------------------------------------

    def reset(self) -> State:
        """Leaves the latch, if its cause is gone. Moves nothing."""
        return cast(State, self._ask("reset")["state"])

    def release(self) -> State:
        """Ends a hold (`after_stop = hold`): on a slope the wheels roll then. Set the parking brake first."""
        return cast(State, self._ask("release")["state"])

    def tare(self, side: str | None = None) -> Tared:
        """Makes the present force the zero: of `left`, `right`, or both wheels. Moves nothing.

        Returns, for each of them, the new zero and how good it is, and the one before.
        """
        return cast(Tared, without_envelope(self._ask("tare", side=side)))

    def confirm(self, item: str, value: str | Whole | None = None, how: str | None = None) -> Confirmed:
        """The operator's word on an item of the assumption ledger (docs/developer/ledger.md). Moves nothing.

        `value` is what was found at the machine; without it what is configured is confirmed. Returns the item's entry: another value
        than the configured one contradicts it, and `disabled` tells what that costs. `how` it was found (up to 127 bytes) is kept as its
        evidence.
        """
        found = value if value is None or isinstance(value, str) else integer("value", value)
        return cast(Confirmed, without_envelope(self._ask("confirm", item=item, value=found, how=how)))

    def config(self, key: str | None = None, value: str | Whole | None = None, *, commit: bool | None = None) -> Configured:
        """The configuration of a gateway that keeps it itself (a board, docs/user/serial.md); a daemon's is its file, and it raises Refused.

        Alone it reads; with `key` (`drive.lease_ms`) and `value` it stages that; with `commit` True it writes what is staged, after
        which the board starts anew and this connection ends, with False it forgets it.
        """
        wanted = value if value is None or isinstance(value, str) else integer("value", value)
        return cast(Configured, without_envelope(self._ask("config", key=key, value=wanted, commit=commit)))

    def arm(self, name: str | None = None, *, takeover: bool = False, wait: float = ARM_S) -> Armed:
        """Asks for permission to drive; the wheels stay at zero until the first command. An older one of this Gateway ends.

        `name` is shown to others. `takeover` takes the lease from somebody else, with the wheels at rest. `wait`: seconds in which a
        stop that is only just over is waited out: wheels that do not count as standing yet (`not_at_rest`), a drive command of
        half a second ago (`stale_command`). Every other refusal is raised at once.
        """
        deadline = time.monotonic() + wait
        while True:
            try:
                reply = self._ask("arm", name=name, takeover=takeover or None)
                break
            except Refused as refusal:
                if refusal.error not in PASSING or not time.monotonic() < deadline:
                    raise
            time.sleep(ARM_AGAIN_S)
        connection = self._connection
        if connection is None:
            raise GatewayUnavailable("the connection was closed while arming")
        try:
            return Armed(self, connection, terms_of(reply))
        except ProtocolError:
            connection.close()
            raise

    # The inside ------------------------------------------------------------------------------------------------------

    @contextmanager
    def _alone(self) -> Iterator[None]:
        if not self._busy.acquire(blocking=False):
            raise RuntimeError("this Gateway is in use by another thread; give each thread its own")
        try:
            yield
        finally:
            self._busy.release()

    def _connected(self, deadline: float | None, any_api: bool = False) -> Connection:
        """The connection, made anew if it broke. Tries until the deadline (None: once)."""
        connection = self._connection
        if connection is None or not connection.alive():
            connection = self._connect(deadline)
        if not any_api:
            try:
                check_api(connection.path, connection.hello or {})
            except ProtocolError:
                connection.close()
                raise
        return connection

    def _connect(self, deadline: float | None) -> Connection:
        pause = 0.02
        while True:
            try:
                connection = Connection(self._path or default_socket(), self._timeout)
                break
            except ProtocolError:
                raise
            except GatewayUnavailable:
                if deadline is None or time.monotonic() + pause > deadline:
                    raise
                time.sleep(pause)
                pause = min(1.0, pause * 2)
        self._connection = connection
        if self._subscription is not None:
            result_of("watch", connection.ask("watch", self._subscription, self._timeout))
        return connection

    def _ask(self, cmd: str, **fields: Any) -> Message:
        with self._alone():
            deadline = time.monotonic() + self._wait if self._wait > 0 else None
            connection = self._connected(deadline, cmd in ALWAYS)
            try:
                return result_of(cmd, connection.ask(cmd, fields, self._timeout))
            except GatewayUnavailable:
                if cmd not in REPEATABLE:
                    raise
            return result_of(cmd, self._connected(deadline, cmd in ALWAYS).ask(cmd, fields, self._timeout))

    def _stop(self, cmd: str, **fields: Any) -> Message:
        """By the connection that is there, else by one of its own: no place is needed for it, and no greeting awaited."""
        with self._alone():
            if self._connection is not None and self._connection.alive():
                try:
                    return result_of(cmd, self._connection.ask(cmd, fields, self._timeout))
                except GatewayUnavailable:
                    pass
            try:
                return result_of(cmd, stop_by_either(self._path or default_socket(), cmd, fields, self._timeout))
            except GatewayUnavailable:
                if self._wait <= 0:
                    raise
        return self._ask(cmd, **fields)  # It may come yet.

    def _ask_on(self, connection: Connection, cmd: str, fields: Message) -> Message:
        """On this connection or not at all. What has come is taken first: the connection's end may be among it."""
        with self._alone():
            connection.alive()
            return result_of(cmd, connection.ask(cmd, fields, self._timeout))

    def _next_event(self, timeout: float | None, latest: bool) -> Event | None:
        with self._alone():
            deadline = time.monotonic() + (timeout if timeout is not None else float("inf"))
            if self._connection is not None and not self._connection.open:
                return self._back_again(deadline)
            connection = self._connection or self._connected(None)
            while True:
                if latest:
                    connection.thin()
                event = connection.take_event()
                if event is not None:
                    return event
                if time.monotonic() > deadline:
                    return None
                try:
                    connection.wait(deadline)
                except GatewayUnavailable as error:
                    if not connection.events:
                        connection.untold = None
                        return {"event": "disconnected", "message": str(error)}

    def _back_again(self, deadline: float) -> Event | None:
        assert self._connection is not None
        left = self._connection.take_event()
        if left is not None:
            return left
        untold, self._connection.untold = self._connection.untold, None
        if untold is not None:
            return {"event": "disconnected", "message": untold}
        try:
            self._connected(deadline)
        except GatewayUnavailable:
            return None
        return {"event": "reconnected"}

    def _wait_for_rest(self, seconds: float) -> bool:
        deadline = time.monotonic() + seconds
        while True:
            if stands(cast(Message, self.status())):
                return True
            if time.monotonic() > deadline:
                return False
            time.sleep(0.02)


class Armed:
    """The permission to drive, from `Gateway.arm`. Use it in a `with`; its end stops the wheels and waits until they stand.

    Each command holds `terms.lease_ms`; the next one must come sooner, or the wheels ramp to zero and this permission is over
    (LeaseEnded). It also is over after a stop, a latch, a lost connection, or another `arm`; it never comes back by itself.
    """

    def __init__(self, gateway: Gateway, connection: Connection, terms: Terms) -> None:
        self.terms = terms
        self._gateway = gateway
        self._connection = connection
        self._ended: str | None = None
        self._fed = time.monotonic() + (terms.first_lease_ms - terms.lease_ms) / 1000
        connection.arms += 1
        self._number = connection.arms

    def drive(self, left_mm_s: Whole, right_mm_s: Whole, left_mA: Whole | None = None, right_mA: Whole | None = None) -> Applied:
        """Sets both wheels' speed. The currents may be left out, both, unless the configuration says current_role = setpoint."""
        fields = integers(left_mm_s=left_mm_s, right_mm_s=right_mm_s, left_mA=left_mA, right_mA=right_mA)
        return self._command("drive", fields)

    def twist(self, v_mm_s: Whole, yaw_mrad_s: Whole) -> Applied:
        """Forward speed and turning rate, positive to the left."""
        return self._command("twist", integers(v_mm_s=v_mm_s, yaw_mrad_s=yaw_mrad_s))

    def drive_for(
        self,
        seconds: float,
        left_mm_s: Whole,
        right_mm_s: Whole,
        left_mA: Whole | None = None,
        right_mA: Whole | None = None,
        *,
        on_status: OnStatus | None = None,
        rate_hz: float | None = None,
    ) -> Applied:
        """Repeats the command for that long, three times per lease or at `rate_hz`, and returns while it still holds.

        `on_status` is called after each command with a snapshot taken then. If it returns True the drive ends; if it raises, that is
        raised here. It is part of the loop that keeps the lease: what takes longer than a lease in there ends the permission.
        """
        end = time.monotonic() + seconds_of(seconds)
        period = period_of(self.terms, rate_hz)
        due = time.monotonic()
        while True:
            applied = self.drive(left_mm_s, right_mm_s, left_mA, right_mA)
            if on_status is not None and on_status(self._status()) is True:
                return applied
            now = time.monotonic()
            if now >= end:
                return applied
            due = min(end, max(now, due + period))
            time.sleep(due - now)

    def stop(self, wait: float = REST_S) -> bool:
        """Ramps to zero and waits that many seconds at most until both wheels stand; True if they do. Ends the permission."""
        self._end("it was stopped")
        self._gateway.stop()
        return self._gateway._wait_for_rest(wait)

    def __enter__(self) -> Armed:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        trouble = "one of them still turns"
        at_rest = False
        try:
            at_rest = self._leave()
        except (IWheelError, RuntimeError) as problem:
            trouble = str(problem)
        finally:
            self._end("its block was left")
            if not at_rest:
                self._connection.close()
            if not self._gateway._kept:
                self._gateway.close()
        if not at_rest:
            warnings.warn(f"the wheels were told to stop but are not known to stand: {trouble}", RuntimeWarning, stacklevel=2)

    # The inside ------------------------------------------------------------------------------------------------------

    def _end(self, reason: str) -> None:
        self._ended = self._ended or reason

    def _command(self, cmd: str, fields: Message) -> Applied:
        if self._number != self._connection.arms:
            self._end("the same Gateway was armed anew")
        if self._ended is not None:
            raise LeaseEnded(f"this permission to drive is over ({self._ended}); arm again")
        asked = time.monotonic()
        try:
            applied = applied_of(self._ask(cmd, fields))
        except Refused as refusal:
            if refusal.error in HARMLESS:
                raise
            self._end(refusal.message)
            raise ended_by(refusal) from refusal
        except ProtocolError as trouble:
            self._end(str(trouble))
            self._connection.close()
            raise
        self._fed = asked  # The lease runs from when the command was sent, at the earliest.
        return applied

    def _ask(self, cmd: str, fields: Message) -> Message:
        """On the connection that was armed; what breaks it ends the permission."""
        try:
            return self._gateway._ask_on(self._connection, cmd, fields)
        except (NoAnswer, ProtocolError) as trouble:
            self._end(str(trouble))
            raise
        except GatewayUnavailable as lost:
            self._end(str(lost))
            raise lost_with(lost) from lost

    def _status(self) -> Status:
        return cast(Status, without_envelope(self._ask("status", {})))

    def _leave(self) -> bool:
        """Stops, unless it is somebody else who drives by now."""
        surely_ours = self._ended is None and time.monotonic() - self._fed < self.terms.lease_ms / 1000
        if not surely_ours and self._somebody_else_drives():
            return True
        return self.stop()

    def _somebody_else_drives(self) -> bool:
        holder = self._gateway.status()["lease"]["holder"]
        return holder is not None and holder != (self._connection.hello or {}).get("client")
