# SPDX-License-Identifier: MIT
"""The client for asyncio. It has the contract of `Gateway` and `Armed`, with `await` before every request.

This package starts no task and repeats no command: if the program's own task hangs, the lease ends.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import socket
import time
import warnings
from collections import deque
from types import TracebackType
from typing import Any, cast
from collections.abc import AsyncIterator, Generator, Mapping

from ._connection import EVENTS_KEPT, ends_in_children
from ._errors import GatewayUnavailable, IWheelError, LeaseEnded, NoAnswer, ProtocolError, Refused
from ._protocol import Configured, Confirmed, Hello, OnRequest, Piece, RecordingEntry, State, Status, Stop, Tared, Watched
from ._stop import STOP_AGAIN_S, in_own_thread, stop_apart
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
    Wire,
    applied_of,
    cannot_connect,
    check_api,
    default_socket,
    ended_by,
    integer,
    integers,
    lost_event,
    lost_with,
    newest,
    period_of,
    reason_of,
    result_of,
    seconds_of,
    at_standstill,
    terms_of,
    without_envelope,
)

CONNECT_AGAIN_S = 0.005


class _Stream(asyncio.Protocol):
    """One connection. The event loop sorts messages into replies and events; this package starts no task.

    Every wait is a plain `await` on a future, with a timer that ends it. `asyncio.wait_for` of Python 3.10 and 3.11 loses a cancellation
    that comes together with the reply, and the cancelled task would drive on.
    """

    def __init__(self, path: str, sock: socket.socket) -> None:
        self.path = path
        self.hello: asyncio.Future[Message] = asyncio.get_running_loop().create_future()
        """The gateway's greeting. Its `client` is the number of this connection, as in `lease.holder` of the status."""
        self.hello.add_done_callback(_retrieved)
        self.arms = 0
        self.reported = False
        """The reader of events has received the end of the connection."""
        self.came = asyncio.Event()
        self.events: deque[Event] = deque()
        self.error: GatewayUnavailable | None = None
        self._lost = 0
        self._latest = False
        self._wire = Wire()
        self._waiting: dict[int, asyncio.Future[Message]] = {}
        self._socket, self._loop = sock, asyncio.get_running_loop()
        self._transport: asyncio.Transport | None = None
        ends_in_children(self)

    @classmethod
    async def connect(cls, path: str, timeout: float) -> _Stream:
        """Connects and waits for the greeting. No request is sent before it."""
        until = time.monotonic() + timeout
        stream = cls(path, await _connected_socket(path, until))
        try:
            await stream._loop.create_unix_connection(lambda: stream, sock=stream._socket)
            error = NoAnswer(f"{path}: the gateway sent no greeting within {timeout:g} s")
            timer = stream._loop.call_later(max(0.0, until - time.monotonic()), _end_wait, stream.hello, error)
            try:
                await stream.hello
            finally:
                timer.cancel()
        except BaseException:
            stream.close()
            raise
        return stream

    @property
    def open(self) -> bool:
        if self.error is None and self._loop.is_closed():
            self.close("its event loop is closed")
        return self.error is None

    def close(self, reason: str = "the connection is closed") -> None:
        """Closes the connection, which ends its lease. It works from any thread, in every state of the loop."""
        error = GatewayUnavailable(f"{self.path}: {reason}")
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        if self._loop.is_closed():
            self.error = self.error or error
            self._socket.close()
        elif _running_loop() is self._loop or not self._loop.is_running():
            self._fail(error)
        # Otherwise the loop runs in another thread, and reads the end of the connection there.

    def is_here(self) -> bool:
        """Returns True in the event loop of this connection."""
        return _running_loop() is self._loop

    def leave(self) -> None:
        """Closes the socket in a forked child, without ending the parent's connection."""
        self.error = GatewayUnavailable(f"{self.path}: the connection belongs to the parent process")
        self._socket.close()

    def post(self, cmd: str, fields: Mapping[str, Any], timeout: float) -> asyncio.Future[Message]:
        """Sends the request immediately. The future returns the reply; if none comes in time, closes the connection and raises NoAnswer."""
        if not self.open or self._transport is None:
            raise self.error or GatewayUnavailable(f"{self.path}: the connection is closed")
        if not self.is_here():
            raise RuntimeError("this AsyncGateway belongs to another event loop; create one for each event loop")
        number, line = self._wire.request(cmd, fields)
        future: asyncio.Future[Message] = self._loop.create_future()
        self._waiting[number] = future
        timer = self._loop.call_later(timeout, self._no_answer, future, cmd, timeout)

        def forget(done: asyncio.Future[Message]) -> None:
            timer.cancel()
            self._waiting.pop(number, None)
            _retrieved(done)

        future.add_done_callback(forget)
        self._transport.write(line)
        return future

    async def ask(self, cmd: str, fields: Mapping[str, Any], timeout: float) -> Message:
        return await self.post(cmd, fields, timeout)

    async def something(self, seconds: float | None) -> None:
        """Waits until an event comes, the connection ends, or the time is over."""
        self.came.clear()
        timer = None if seconds is None else self._loop.call_later(max(0.0, seconds), self.came.set)
        try:
            await self.came.wait()
        finally:
            if timer is not None:
                timer.cancel()

    def take_event(self, latest: bool = False) -> Event | None:
        self._latest = latest
        if latest:
            self._leave_out()
        if self._lost > 0:
            count, self._lost = self._lost, 0
            return lost_event(count)
        return self.events.popleft() if self.events else None

    def _leave_out(self) -> None:
        retained, left_out = newest(self.events)
        self.events, self._lost = deque(retained), self._lost + left_out

    # Functions that the event loop calls

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)

    def data_received(self, data: bytes) -> None:
        if self.error is not None:
            return
        try:
            for message in self._wire.feed(data):
                self._sort(message)
        except GatewayUnavailable as error:
            self._fail(error)

    def connection_lost(self, problem: Exception | None) -> None:
        broke = "the gateway closed the connection" if problem is None else f"the connection broke ({problem})"
        self._fail(GatewayUnavailable(f"{self.path}: {broke}"))

    def _sort(self, message: Message) -> None:
        if "ok" in message:
            number = message.get("id")
            if number is None:
                raise GatewayUnavailable(f"{self.path}: {message.get('error')}: {message.get('message')}")
            future = self._waiting.get(number)
            if future is not None and not future.done():
                future.set_result(message)
            return
        if message["event"] == "hello":
            if not self.hello.done():
                self.hello.set_result(message)
            return
        if self._latest and len(self.events) >= EVENTS_KEPT:
            self._leave_out()
        if len(self.events) >= EVENTS_KEPT:
            self.events.popleft()
            self._lost += 1
        self.events.append(cast(Event, message))
        self.came.set()

    def _no_answer(self, future: asyncio.Future[Message], cmd: str, timeout: float) -> None:
        if not future.done():
            what = f"{self.path}: no answer to {cmd} within {timeout:g} s; the connection was closed"
            future.set_exception(NoAnswer(what))
            self.close()

    def _fail(self, error: GatewayUnavailable) -> None:
        if self.error is not None:
            return
        self.error = error
        if self._transport is not None:
            self._transport.abort()
        else:
            self._socket.close()
        for future in (self.hello, *self._waiting.values()):
            _end_wait(future, error)
        self.came.set()


async def _connected_socket(path: str, until: float) -> socket.socket:
    """Connects. A connect to a local socket does not wait, unless the queue of connections is full."""
    sock = socket.socket(socket.AF_UNIX)
    try:
        sock.setblocking(False)
        while True:
            try:
                sock.connect(path)
                return sock
            except BlockingIOError as error:
                if time.monotonic() > until:
                    raise cannot_connect(path, error) from None
            await asyncio.sleep(CONNECT_AGAIN_S)
    except OSError as error:
        sock.close()
        raise cannot_connect(path, error) from None
    except BaseException:
        sock.close()
        raise


def _end_wait(future: asyncio.Future[Message], error: GatewayUnavailable) -> None:
    if not future.done():
        future.set_exception(error)


def _retrieved(future: asyncio.Future[Message]) -> None:
    """Marks the error of a future as read: no task waits for it any more, because it was cancelled."""
    if not future.cancelled():
        future.exception()


def _running_loop() -> asyncio.AbstractEventLoop | None:
    try:
        return asyncio.get_running_loop()
    except RuntimeError:
        return None


class AsyncGateway:
    """Like `Gateway`. All tasks of one event loop may share it; each reader of events should have its own. `stop` and `estop` work in every event loop."""

    def __init__(self, socket: str | None = None, *, timeout: float = 1.0, wait: float = 0.0) -> None:
        self._path = socket
        self._timeout = timeout
        self._wait = wait
        self._stream: _Stream | None = None
        self._subscription: Message | None = None
        self._connecting = asyncio.Lock()
        self._stops = 0
        self._kept = False

    async def __aenter__(self) -> AsyncGateway:
        self._kept = True
        return self

    async def __aexit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._kept = False
        self.close()

    def close(self) -> None:
        """Closes the connection, which ends its lease. The next request connects again."""
        stream, self._stream = self._stream, None
        if stream is not None:
            stream.close()

    def __del__(self) -> None:
        """Closes the connection of an object that the program has dropped; the event loop would hold it open."""
        if getattr(self, "_stream", None) is not None:
            self.close()

    async def hello(self) -> Hello:
        return cast(Hello, without_envelope(await self._ask("hello")))

    async def status(self) -> Status:
        return cast(Status, without_envelope(await self._ask("status")))

    async def why(self) -> Stop:
        return cast(Stop, without_envelope(await self._ask("why")))

    async def recordings(self) -> list[RecordingEntry]:
        return cast(list[RecordingEntry], (await self._ask("recordings"))["recordings"])

    async def recording(self, name: str) -> bytes:
        data = bytearray()
        while not add_piece(data, cast(Piece, await self._ask("recording", name=name, offset=len(data)))):
            pass
        return bytes(data)

    async def record_on_request(self, on: bool) -> OnRequest:
        return cast(OnRequest, without_envelope(await self._ask("record", on=bool(on))))

    async def watch(self, *topics: str, rate_hz: Whole | None = None) -> Watched:
        fields = {"topics": list(topics), **integers(rate_hz=rate_hz)}
        granted = await self._ask("watch", **fields)
        self._subscription = fields if topics else None
        return cast(Watched, without_envelope(granted))

    async def events(self, timeout: float | None = None, *, latest: bool = False) -> AsyncIterator[Event]:
        """Like `Gateway.events`, with `disconnected`, `reconnected` and `lost`."""
        while True:
            event = await self._next_event(timeout, latest)
            if event is None:
                return
            yield event

    async def stop(self) -> State:
        self._stops += 1
        return cast(State, (await self._stop("stop"))["state"])

    async def estop(self, reason: object = None) -> State:
        return cast(State, (await self._stop("estop", reason=reason_of(reason)))["state"])

    async def reset(self) -> State:
        return cast(State, (await self._ask("reset"))["state"])

    async def release(self) -> State:
        return cast(State, (await self._ask("release"))["state"])

    async def tare(self, side: str | None = None) -> Tared:
        return cast(Tared, without_envelope(await self._ask("tare", side=side)))

    async def confirm(self, item: str, value: str | Whole | None = None, how: str | None = None) -> Confirmed:
        found = value if value is None or isinstance(value, str) else integer("value", value)
        return cast(Confirmed, without_envelope(await self._ask("confirm", item=item, value=found, how=how)))

    async def config(self, key: str | None = None, value: str | Whole | None = None, *, commit: bool | None = None) -> Configured:
        """Like `Gateway.config`."""
        wanted = value if value is None or isinstance(value, str) else integer("value", value)
        return cast(Configured, without_envelope(await self._ask("config", key=key, value=wanted, commit=commit)))

    def arm(self, name: str | None = None, *, takeover: bool = False, wait: float = ARM_S) -> _Arming:
        """Like `Gateway.arm`. Use `async with gateway.arm("name") as wheels:`, or `wheels = await gateway.arm("name")`."""
        return _Arming(self, name, takeover, wait)

    # Private ---------------------------------------------------------------------------------------------------------

    async def _connected(self, deadline: float | None) -> _Stream:
        async with self._connecting:
            stream = self._stream
            if stream is None or not stream.open:
                stream = await self._connect(deadline)
            try:
                check_api(stream.path, stream.hello.result())
            except ProtocolError:
                stream.close()
                raise
            return stream

    async def _connect(self, deadline: float | None) -> _Stream:
        pause = 0.02
        while True:
            try:
                stream = await _Stream.connect(self._path or default_socket(), self._timeout)
                break
            except ProtocolError:
                raise
            except GatewayUnavailable:
                if deadline is None or time.monotonic() + pause > deadline:
                    raise
                await asyncio.sleep(pause)
                pause = min(1.0, pause * 2)
        self._stream = stream
        if self._subscription is not None:
            result_of("watch", await stream.ask("watch", self._subscription, self._timeout))
        return stream

    async def _ask(self, cmd: str, **fields: Any) -> Message:
        deadline = time.monotonic() + self._wait if self._wait > 0 else None
        stream = await self._connected(deadline)
        try:
            return result_of(cmd, await stream.ask(cmd, fields, self._timeout))
        except GatewayUnavailable:
            if cmd not in REPEATABLE:
                raise
        return result_of(cmd, await (await self._connected(deadline)).ask(cmd, fields, self._timeout))

    async def _stop(self, cmd: str, **fields: Any) -> Message:
        """Sends a stop through the open connection. If there is none, or another event loop uses it, sends the stop through a separate connection, which
        needs no place at the gateway and does not wait for the greeting. The first step sends it."""
        deadline = time.monotonic() + self._wait
        stream = self._stream
        if stream is not None and stream.open and stream.is_here():
            try:
                return result_of(cmd, await stream.ask(cmd, fields, self._timeout))
            except GatewayUnavailable:
                pass
        while True:
            try:
                sent = in_own_thread(functools.partial(stop_apart, self._known_path(), cmd, fields, self._timeout))
                return result_of(cmd, await asyncio.wrap_future(sent))
            except GatewayUnavailable:
                if not time.monotonic() < deadline:
                    raise
            await asyncio.sleep(STOP_AGAIN_S)  # The gateway may still start.

    def _known_path(self) -> str | None:
        """Returns the socket of this AsyncGateway; None if no program named it and there is no connection."""
        return self._path or (self._stream.path if self._stream is not None and self._stream.open else None)

    async def _arm(self, name: str | None, takeover: bool, wait: float) -> AsyncArmed:
        until, stops = time.monotonic() + wait, self._stops
        asked = ArmTime(await self._ask("status"))
        stream = self._stream
        if stream is None:
            raise GatewayUnavailable("the connection was closed while arming")
        while True:
            try:
                fields = {"name": name, "takeover": takeover or None, "t_us": asked.t_us}
                armed = AsyncArmed(self, stream, terms_of(result_of("arm", await stream.ask("arm", fields, self._timeout))))
                if self._stops != stops:
                    armed._end(STOPPED_MEANWHILE)
                return armed
            except Refused as refusal:
                if asked.is_unknown(refusal):
                    continue
                if not asked.refused(refusal) or not time.monotonic() < until:
                    raise asked.reason(refusal) from None
            except BaseException:  # Cancelled, dropped, no usable reply: only closing the connection surely ends a lease that began.
                stream.close("arming was interrupted")
                raise
            await asyncio.sleep(ARM_AGAIN_S)
            asked.begin(result_of("status", await stream.ask("status", {}, self._timeout)))

    async def _next_event(self, timeout: float | None, latest: bool) -> Event | None:
        deadline = time.monotonic() + (timeout if timeout is not None else float("inf"))
        if self._stream is None:
            await self._connected(None)
        stream = self._stream
        while stream is not None:
            event = stream.take_event(latest)
            if event is not None:
                return event
            if not stream.open:
                return await self._gone(stream, deadline)
            left = deadline - time.monotonic()
            if left <= 0:
                return None
            await stream.something(left if timeout is not None else None)
        return None

    async def _gone(self, stream: _Stream, deadline: float) -> Event | None:
        if not stream.reported:
            stream.reported = True
            return {"event": "disconnected", "message": str(stream.error)}
        try:
            await self._connected(deadline)
        except GatewayUnavailable:
            return None
        return {"event": "reconnected"}

    async def _wait_for_rest(self, seconds: float) -> bool:
        if self._stream is not None and self._stream.open and not self._stream.is_here():
            async with AsyncGateway(self._known_path(), timeout=self._timeout) as other:
                return await other._wait_for_rest(seconds)
        deadline = time.monotonic() + seconds
        while True:
            if at_standstill(cast(Message, await self.status())):
                return True
            if time.monotonic() > deadline:
                return False
            await asyncio.sleep(0.02)


class _Arming:
    """Result of `AsyncGateway.arm`, for `await` or `async with`."""

    def __init__(self, gateway: AsyncGateway, name: str | None, takeover: bool, wait: float) -> None:
        self._gateway, self._name, self._takeover, self._wait = gateway, name, takeover, wait
        self._armed: AsyncArmed | None = None

    def __await__(self) -> Generator[Any, None, AsyncArmed]:
        return self._gateway._arm(self._name, self._takeover, self._wait).__await__()

    async def __aenter__(self) -> AsyncArmed:
        try:
            self._armed = await self
        except BaseException:
            if not self._gateway._kept:
                self._gateway.close()
            raise
        return self._armed

    async def __aexit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        assert self._armed is not None
        await self._armed.__aexit__(kind, error, trace)


class AsyncArmed:
    """Like `Armed`. A cancelled task also stops the wheels."""

    def __init__(self, gateway: AsyncGateway, stream: _Stream, terms: Terms) -> None:
        self.terms = terms
        self._gateway = gateway
        self._stream = stream
        self._ended: str | None = None
        self._fed = time.monotonic() + (terms.first_lease_ms - terms.lease_ms) / 1000
        stream.arms += 1
        self._number = stream.arms

    async def drive(self, left_mm_s: Whole, right_mm_s: Whole, left_mA: Whole | None = None, right_mA: Whole | None = None) -> Applied:
        fields = integers(left_mm_s=left_mm_s, right_mm_s=right_mm_s, left_mA=left_mA, right_mA=right_mA)
        return await self._command("drive", fields)

    async def twist(self, v_mm_s: Whole, yaw_mrad_s: Whole) -> Applied:
        return await self._command("twist", integers(v_mm_s=v_mm_s, yaw_mrad_s=yaw_mrad_s))

    async def drive_for(
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
        """Like `Armed.drive_for`; `on_status` is an ordinary function, not a coroutine."""
        end = time.monotonic() + seconds_of(seconds)
        period = period_of(self.terms, rate_hz)
        due = time.monotonic()
        while True:
            applied = await self.drive(left_mm_s, right_mm_s, left_mA, right_mA)
            if on_status is not None and on_status(await self._status()) is True:
                return applied
            now = time.monotonic()
            if now >= end:
                return applied
            due = min(end, max(now, due + period))
            await asyncio.sleep(due - now)

    async def stop(self, wait: float = REST_S) -> bool:
        self._end("it was stopped")
        await self._gateway._stop("stop")
        return await self._gateway._wait_for_rest(wait)

    async def __aenter__(self) -> AsyncArmed:
        return self

    async def __aexit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if kind is GeneratorExit:  # The program has dropped the task: no wait is possible any more.
            self._end("its task was dropped")
            self._stream.close()
            return
        trouble = "one of them still turns"
        at_rest = False
        try:
            at_rest = await self._leave()
        except IWheelError as problem:
            trouble = str(problem)
        finally:
            self._end("its `async with` block ended")
            if not at_rest:
                self._stream.close()
            if not self._gateway._kept:
                self._gateway.close()
        if not at_rest:
            warnings.warn(f"the wheels were commanded to stop, but may still turn: {trouble}", RuntimeWarning, stacklevel=2)

    def _end(self, reason: str) -> None:
        self._ended = self._ended or reason

    async def _command(self, cmd: str, fields: Message) -> Applied:
        if self._number != self._stream.arms:
            self._end("the same AsyncGateway was armed again")
        if self._ended is not None:
            raise LeaseEnded(f"this permission to drive is over ({self._ended}); arm again")
        asked = time.monotonic()
        try:
            applied = applied_of(await self._ask(cmd, fields))
        except Refused as refusal:
            if refusal.error in HARMLESS:
                raise
            self._end(refusal.message)
            raise ended_by(refusal) from refusal
        except ProtocolError as trouble:
            self._end(str(trouble))
            self._stream.close()
            raise
        self._fed = asked
        return applied

    async def _ask(self, cmd: str, fields: Message) -> Message:
        try:
            return result_of(cmd, await self._stream.ask(cmd, fields, self._gateway._timeout))
        except (NoAnswer, ProtocolError) as trouble:
            self._end(str(trouble))
            raise
        except GatewayUnavailable as lost:
            self._end(str(lost))
            raise lost_with(lost) from lost

    async def _status(self) -> Status:
        return cast(Status, without_envelope(await self._ask("status", {})))

    async def _leave(self) -> bool:
        surely_ours = self._ended is None and time.monotonic() - self._fed < self.terms.lease_ms / 1000
        if not surely_ours:
            holder = (await self._gateway.status())["lease"]["holder"]
            if holder is not None and holder != self._stream.hello.result().get("client"):
                return True
        return await self.stop()
