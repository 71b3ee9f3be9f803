# SPDX-License-Identifier: MIT
"""The client for programs without asyncio. Contract: see `Gateway` and `Armed`."""

from __future__ import annotations

import math
import os
import threading
import time
import warnings
from contextlib import contextmanager
from types import TracebackType
from typing import Any, cast
from collections.abc import Iterator

from ._connection import Connection
from ._errors import GatewayUnavailable, IWheelError, LeaseEnded, NoAnswer, ProtocolError, Refused
from ._protocol import Configured, Confirmed, Hello, OnRequest, Piece, RecordingEntry, State, Status, Stop, Tared, Watched
from ._record import record
from ._stop import STOP_AGAIN_S, stop_apart
from ._types import Applied, Event, OnStatus, Terms, Whole
from ._wire import (
    ARM_AGAIN_S,
    ARM_S,
    HARMLESS,
    REPEATABLE,
    REST_S,
    STOPPED_MEANWHILE,
    ArmTime,
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
    reason_of,
    result_of,
    seconds_of,
    at_standstill,
    terms_of,
    without_envelope,
)


class Gateway:
    """A connection to the gateway. It connects with the first request, and again after the connection broke. It never resumes driving.

    `socket`: path of the socket; by default $IWHEEL_SOCKET, or the only gateway in /run/iwheel. If several run there, a Gateway without a connection
    sends `stop` and `estop` to all of them. `timeout`: longest wait for each reply, in seconds.
    `wait`: longest wait for a gateway that is not running (yet), in seconds.

    One thread at a time: create a Gateway for each thread. `stop`, `estop` and `close` work from every thread at any time. `with` closes the connection
    at its end.
    """

    def __init__(self, socket: str | None = None, *, timeout: float = 1.0, wait: float = 0.0) -> None:
        self._path = socket
        self._timeout = timeout
        self._wait = wait
        self._connection: Connection | None = None
        self._subscription: Message | None = None
        self._busy = threading.RLock()
        self._user = 0
        """The last thread that sent a request. A stop by another thread must not disturb its requests."""
        self._stops = 0
        """Number of calls of `stop`. An `arm` that began before the last one grants nothing."""
        self._kept = False

    def __enter__(self) -> Gateway:
        self._kept = True
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._kept = False
        self.close()

    def close(self) -> None:
        """Closes the connection, which ends its lease. The next request connects again."""
        connection, self._connection = self._connection, None
        if connection is not None:
            connection.close()

    # Reading: moves nothing ------------------------------------------------------------------------------------------

    def hello(self) -> Hello:
        """Data of the gateway and the connection: `name version api bus state client rights`; `rights` is `drive` or `watch`."""
        return cast(Hello, without_envelope(self._ask("hello")))

    def status(self) -> Status:
        """Returns a complete snapshot."""
        return cast(Status, without_envelope(self._ask("status")))

    def why(self) -> Stop:
        """Returns the last stop; `sentence` describes it in plain English."""
        return cast(Stop, without_envelope(self._ask("why")))

    def recordings(self) -> list[RecordingEntry]:
        """Lists the recordings of stops on the gateway's disk, oldest first: `name cause wall_us log_bytes jsonl_bytes conf_bytes`."""
        return cast(list[RecordingEntry], self._ask("recordings")["recordings"])

    def recording(self, name: str) -> bytes:
        """Returns a whole file of a recording, after checking it. `name`: a name from `recordings`, with .log, .jsonl or .conf added."""
        data = bytearray()
        while not add_piece(data, cast(Piece, self._ask("recording", name=name, offset=len(data)))):
            pass
        return bytes(data)

    def record_on_request(self, on: bool) -> OnRequest:
        """Begins or ends the recording on request on the gateway's disk. It moves nothing."""
        return cast(OnRequest, without_envelope(self._ask("record", on=bool(on))))

    def watch(self, *topics: str, rate_hz: Whole | None = None) -> Watched:
        """Subscribes to topics of `state bus estop lease stop force frame`, instead of those before. Then read `events`.

        Returns the accepted subscription: `topics rate_hz limited`.
        """
        fields = {"topics": list(topics), **integers(rate_hz=rate_hz)}
        granted = self._ask("watch", **fields)
        self._subscription = fields if topics else None
        return cast(Watched, without_envelope(granted))

    def events(self, timeout: float | None = None, *, latest: bool = False) -> Iterator[Event]:
        """Yields events as they come. Ends when none came for `timeout` seconds (None: never ends).

        A lost connection is an event too: `disconnected`, then `reconnected` with the same subscription as soon as the gateway is back. `lost`
        states how many events the program did not read in time.

        `latest`: for slow programs. It yields only the newest event of each kind instead of a backlog (`fault`, `offset`, `ledger` and `frame`
        have a kind for each cause, side, item, id), after a `lost` with the number of dropped events.
        """
        while True:
            event = self._next_event(timeout, latest)
            if event is None:
                return
            yield event

    def record(self, path: str | os.PathLike[str], seconds: float = math.inf) -> int:
        """Writes all frames of the bus to a new file, in the form of candump -L, for that time or until Ctrl-C (KeyboardInterrupt). Moves nothing.

        Returns the number of frames. It continues after a lost connection; a comment in the file marks missing frames. `read_recording` reads the
        file. It replaces the subscription of `watch`, and ends it.
        """
        return record(self, path, seconds)

    # Stopping: always allowed ----------------------------------------------------------------------------------------

    def stop(self) -> State:
        """Stops the wheels with the ramp, whichever client drives. Returns the state after that."""
        self._stops += 1
        return cast(State, self._stop("stop")["state"])

    def estop(self, reason: object = None) -> State:
        """Stops the wheels without a ramp, latched until `reset`. It does not replace the button that cuts power.

        `reason` appears in `why`, as one line of at most 200 bytes. It can be any object, for example an exception: this method uses its text.
        """
        return cast(State, self._stop("estop", reason=reason_of(reason))["state"])

    # Requests that need a decision -----------------------------------------------------------------------------------

    def reset(self) -> State:
        """Ends the latched state, if its cause is gone. Moves nothing."""
        return cast(State, self._ask("reset")["state"])

    def release(self) -> State:
        """Ends the hold of zeros (`after_stop = hold`). On a slope the wheels then roll: set the parking brake first."""
        return cast(State, self._ask("release")["state"])

    def tare(self, side: str | None = None) -> Tared:
        """Makes the present force the zero of `left`, `right`, or both wheels. Moves nothing.

        Returns for each wheel the new zero with its quality, and the zero before.
        """
        return cast(Tared, without_envelope(self._ask("tare", side=side)))

    def confirm(self, item: str, value: str | Whole | None = None, how: str | None = None) -> Confirmed:
        """Stores the operator's decision about an assumption (docs/developer/ledger.md). Moves nothing.

        `value` is the value found at the machine; None confirms the configured value. Returns the entry of the item. A value that differs from
        the configured one contradicts it, and `disabled` states the consequence. The gateway stores `how` (up to 127 bytes), the method.
        """
        found = value if value is None or isinstance(value, str) else integer("value", value)
        return cast(Confirmed, without_envelope(self._ask("confirm", item=item, value=found, how=how)))

    def config(self, key: str | None = None, value: str | Whole | None = None, *, commit: bool | None = None) -> Configured:
        """Reads or changes the configuration of a gateway that stores it itself (a board, docs/user/serial.md). A daemon has a file and raises Refused.

        Without arguments it reads. With `key` (`drive.lease_ms`) and `value` it stages a value. `commit` True writes the staged values; then the
        board restarts and this connection ends. `commit` False discards them.
        """
        wanted = value if value is None or isinstance(value, str) else integer("value", value)
        return cast(Configured, without_envelope(self._ask("config", key=key, value=wanted, commit=commit)))

    def arm(self, name: str | None = None, *, takeover: bool = False, wait: float = ARM_S) -> Armed:
        """Requests the permission to drive; the wheels stay at zero until the first command. An older permission of this Gateway ends.

        Other clients can read `name`. `takeover` transfers the lease from another client, with the wheels at standstill. `wait`: seconds for which
        the call repeats the request after a recent stop: while the wheels do not count as at standstill (`not_at_rest`), or a drive command is less
        than half a second old (`stale_command`). It raises every other refusal immediately. A `stop` of any client in the meantime ends the wait
        (`stale_command`, with a message about the stop), and so does the end of the connection. A `stop` of this Gateway, by another thread, also
        ends a permission that was just granted. A drive command of another client that continues ends the wait after `[northbound] max_age_ms`
        (1 s by default) at the latest. A `stop` before the call does not prevent it: after LeaseEnded let a person decide before the next `arm`.
        Only `estop` keeps all clients from driving, until `reset`.
        """
        deadline, stops = time.monotonic() + wait, self._stops
        asked = ArmTime(self._ask("status"))
        connection = self._connection
        if connection is None:
            raise GatewayUnavailable("the connection was closed while arming")
        while True:
            try:
                fields = {"name": name, "takeover": takeover or None, "t_us": asked.t_us}
                reply = self._ask_on(connection, "arm", fields)
                break
            except Refused as refusal:
                if asked.is_unknown(refusal):
                    continue
                if not asked.refused(refusal) or not time.monotonic() < deadline:
                    raise asked.reason(refusal) from None
            time.sleep(ARM_AGAIN_S)
            asked.begin(self._ask_on(connection, "status", {}))
        try:
            armed = Armed(self, connection, terms_of(reply))
        except ProtocolError:
            connection.close()
            raise
        if self._stops != stops:
            armed._end(STOPPED_MEANWHILE)
        return armed

    # Private ---------------------------------------------------------------------------------------------------------

    @contextmanager
    def _alone(self) -> Iterator[None]:
        if not self._busy.acquire(blocking=False):
            raise RuntimeError("this Gateway is in use by another thread; create one for each thread")
        self._user = threading.get_ident()
        try:
            yield
        finally:
            self._busy.release()

    def _connected(self, deadline: float | None) -> Connection:
        """Returns the connection, a new one if the last one broke. Tries until the deadline (None: once)."""
        connection = self._connection
        if connection is None or not connection.alive():
            connection = self._connect(deadline)
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
            connection = self._connected(deadline)
            try:
                return result_of(cmd, connection.ask(cmd, fields, self._timeout))
            except GatewayUnavailable:
                if cmd not in REPEATABLE:
                    raise
            return result_of(cmd, self._connected(deadline).ask(cmd, fields, self._timeout))

    def _stop(self, cmd: str, **fields: Any) -> Message:
        """Sends a stop through the open connection. If there is none, or another thread uses it, sends the stop through a separate connection, which
        needs no place at the gateway and does not wait for the greeting."""
        deadline = time.monotonic() + self._wait
        connection = self._connection
        if connection is not None and self._user == threading.get_ident() and self._busy.acquire(blocking=False):
            try:
                if connection.alive():
                    return result_of(cmd, connection.ask(cmd, fields, self._timeout))
            except GatewayUnavailable:
                pass
            finally:
                self._busy.release()
        while True:
            try:
                return result_of(cmd, stop_apart(self._known_path(), cmd, fields, self._timeout))
            except GatewayUnavailable:
                if not time.monotonic() < deadline:
                    raise
            time.sleep(STOP_AGAIN_S)  # The gateway may still start.

    def _known_path(self) -> str | None:
        """Returns the socket of this Gateway; None if no program named it and there is no connection."""
        connection = self._connection
        return self._path or (connection.path if connection is not None and connection.open else None)

    def _ask_on(self, connection: Connection, cmd: str, fields: Message) -> Message:
        """Sends a request on this connection only. Reads all that has come first, because the connection may have ended."""
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
                        connection.unreported = None
                        return {"event": "disconnected", "message": str(error)}

    def _back_again(self, deadline: float) -> Event | None:
        assert self._connection is not None
        left = self._connection.take_event()
        if left is not None:
            return left
        unreported, self._connection.unreported = self._connection.unreported, None
        if unreported is not None:
            return {"event": "disconnected", "message": unreported}
        try:
            self._connected(deadline)
        except GatewayUnavailable:
            return None
        return {"event": "reconnected"}

    def _wait_for_rest(self, seconds: float) -> bool:
        deadline = time.monotonic() + seconds
        while True:
            try:
                status = self.status()
            except RuntimeError:  # Another thread uses this Gateway.
                with Gateway(self._known_path(), timeout=self._timeout) as other:
                    return other._wait_for_rest(deadline - time.monotonic())
            if at_standstill(cast(Message, status)):
                return True
            if time.monotonic() > deadline:
                return False
            time.sleep(0.02)


class Armed:
    """The permission to drive, from `Gateway.arm`. Use it in a `with`; its end stops the wheels and waits for standstill.

    Each command is valid for `terms.lease_ms`. If the next one comes later, the wheels ramp to zero and this permission is over (LeaseEnded). It is
    also over after a stop, a latch, a lost connection, or another `arm`. It never becomes valid again.
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
        """Sets the speeds of both wheels. Both currents may be None, unless the configuration has current_role = setpoint."""
        fields = integers(left_mm_s=left_mm_s, right_mm_s=right_mm_s, left_mA=left_mA, right_mA=right_mA)
        return self._command("drive", fields)

    def twist(self, v_mm_s: Whole, yaw_mrad_s: Whole) -> Applied:
        """Sets forward speed and yaw rate, positive to the left."""
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
        """Repeats the command for that time, three times per lease or at `rate_hz`, and returns while the last command is still valid.

        It calls `on_status` after each command with a new snapshot. If `on_status` returns True, the drive ends; if it raises, the exception leaves
        `drive_for`. The loop extends the lease, so an `on_status` that takes longer than a lease ends the permission.
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
        """Ramps to zero and waits at most `wait` seconds for standstill of both wheels. Returns True if they reached it. Ends the permission."""
        self._end("it was stopped")
        self._gateway._stop("stop")
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
            self._end("its `with` block ended")
            if not at_rest:
                self._connection.close()
            if not self._gateway._kept:
                self._gateway.close()
        if not at_rest:
            warnings.warn(f"the wheels were commanded to stop, but may still turn: {trouble}", RuntimeWarning, stacklevel=2)

    # Private ---------------------------------------------------------------------------------------------------------

    def _end(self, reason: str) -> None:
        self._ended = self._ended or reason

    def _command(self, cmd: str, fields: Message) -> Applied:
        if self._number != self._connection.arms:
            self._end("the same Gateway was armed again")
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
        self._fed = asked  # The lease begins when the command was sent, at the earliest.
        return applied

    def _ask(self, cmd: str, fields: Message) -> Message:
        """Sends a request on the armed connection. A broken connection ends the permission."""
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
        """Stops the wheels, unless another client drives now."""
        surely_ours = self._ended is None and time.monotonic() - self._fed < self.terms.lease_ms / 1000
        if not surely_ours and self._another_client_drives():
            return True
        return self.stop()

    def _another_client_drives(self) -> bool:
        holder = self._gateway.status()["lease"]["holder"]
        return holder is not None and holder != (self._connection.hello or {}).get("client")
