# SPDX-License-Identifier: MIT
"""One connection to the gateway's socket, used from one thread."""

from __future__ import annotations

import contextlib
import math
import os
import select
import socket
import time
import weakref
from collections import deque
from typing import Any, Protocol, cast
from collections.abc import Mapping

from ._errors import GatewayUnavailable, NoAnswer, ProtocolError
from ._types import Event
from ._wire import Message, Wire, cannot_connect, lost_event, newest

EVENTS_KEPT = 1000
SLICE_S = 0.05
"""Longest single wait: a signal handler may have read the awaited message, so the wait checks again after this time."""


class _Left(Protocol):
    def leave(self) -> None: ...


class Connection:
    """Matches replies by number. Stores events until the program reads them; if there are too many, drops and counts the oldest."""

    def __init__(self, path: str, timeout: float) -> None:
        self.path = path
        self.hello: Message | None = None
        """The gateway's greeting. Its `client` is the number of this connection, as in `lease.holder` of the status."""
        self.arms = 0
        """Number of arms on this connection: only the last permission is valid."""
        self.events: deque[Event] = deque()
        self._latest = False
        self.unreported: str | None = None
        """Why the connection ended, if the reader of events has not received it yet."""
        self._lost = 0
        self._wire = Wire()
        self._replies: dict[int, Message] = {}
        self._wanted: set[int] = set()
        self._sending = False
        self._error: GatewayUnavailable | None = None
        """Why the connection ended, unless this side closed it."""
        self._socket: socket.socket | None = socket.socket(socket.AF_UNIX)
        self._socket.settimeout(timeout)
        try:
            self._socket.connect(path)
            self._socket.setblocking(False)
        except OSError as error:
            self.close()
            raise cannot_connect(path, error) from None
        ends_in_children(self)
        self._greet(timeout)

    def _greet(self, timeout: float) -> None:
        """Waits for the greeting. No request is sent before it."""
        deadline = time.monotonic() + timeout
        while self.hello is None:
            self.wait(deadline)
            if self.hello is None and time.monotonic() > deadline:
                raise self._fail(NoAnswer(f"{self.path}: the gateway sent no greeting within {timeout:g} s"))

    def close(self) -> None:
        """Closes the connection, which ends its lease. It works in every state."""
        gone, self._socket = self._socket, None
        if gone is not None:
            with contextlib.suppress(OSError):
                gone.shutdown(socket.SHUT_RDWR)
            gone.close()

    def leave(self) -> None:
        """Closes the socket in a forked child, without ending the parent's connection."""
        gone, self._socket = self._socket, None
        if gone is not None:
            gone.close()

    @property
    def open(self) -> bool:
        return self._socket is not None

    def alive(self) -> bool:
        """Reads all that has come. Returns False if the gateway has closed the connection."""
        try:
            while self._readable(0.0):
                self._read()
        except GatewayUnavailable:
            pass
        return self.open

    def ask(self, cmd: str, fields: Mapping[str, Any], timeout: float) -> Message:
        """Sends a request and returns the reply. If none comes within `timeout`, closes the connection and raises GatewayUnavailable."""
        number, line = self._wire.request(cmd, fields)
        deadline = time.monotonic() + timeout
        self._wanted.add(number)
        try:
            self._send(line, deadline, cmd)
            while number not in self._replies:
                self.wait(deadline)
                if time.monotonic() > deadline and number not in self._replies:
                    self.close()
                    raise NoAnswer(f"{self.path}: no answer to {cmd} within {timeout:g} s; the connection was closed")
            return self._replies[number]
        finally:
            self._wanted.discard(number)
            self._replies.pop(number, None)

    def wait(self, deadline: float) -> None:
        """Waits for data, at most until the deadline or for SLICE_S, and reads it."""
        if self._readable(min(SLICE_S, max(0.0, deadline - time.monotonic()))):
            self._read()

    def take_event(self) -> Event | None:
        """Returns the oldest event; None if there is none."""
        if self._lost > 0:
            count, self._lost = self._lost, 0
            return lost_event(count)
        return self.events.popleft() if self.events else None

    def thin(self) -> None:
        """Reads all that has come and drops every event that a newer one supersedes; from now on also when too many are stored."""
        self._latest = True
        try:
            while self.open and self._readable(0.0):
                self._read()
        except GatewayUnavailable as error:
            self.unreported = str(error)
        self._leave_out()

    def _leave_out(self) -> None:
        newest_events, left_out = newest(self.events)
        self.events, self._lost = deque(newest_events), self._lost + left_out

    def _fail(self, error: GatewayUnavailable) -> GatewayUnavailable:
        self._error = self._error or error
        self.close()
        return error

    def _require(self) -> socket.socket:
        if self._socket is None:
            reason = f"{self.path}: the connection is closed" if self._error is None else str(self._error)
            raise GatewayUnavailable(reason)
        return self._socket

    def _readable(self, seconds: float) -> bool:
        return self._ready(select.POLLIN, seconds)

    def _ready(self, what: int, seconds: float) -> bool:
        """Waits with poll, because select refuses a descriptor above 1023, and a program with as many open files could not stop."""
        poller = select.poll()
        try:
            poller.register(self._require(), what)
        except ValueError:  # A signal handler has closed the socket in the meantime.
            raise GatewayUnavailable(f"{self.path}: the connection is closed") from None
        return bool(poller.poll(math.ceil(seconds * 1000)))

    def _send(self, line: bytes, deadline: float, cmd: str) -> None:
        sock = self._require()
        if self._sending:  # A request was interrupted after half of it was sent; only closing the connection ends it.
            raise self._fail(GatewayUnavailable(f"{self.path}: a request was interrupted; the connection was closed"))
        self._sending = True
        while line:
            left = deadline - time.monotonic()
            if left <= 0 or not self._ready(select.POLLOUT, left):
                raise self._fail(NoAnswer(f"{self.path}: the gateway does not accept {cmd}; the connection was closed"))
            try:
                line = line[sock.send(line) :]
            except BlockingIOError:
                continue
            except OSError as error:
                raise self._fail(GatewayUnavailable(f"{self.path}: the gateway closed the connection ({error})")) from None
        self._sending = False

    def _read(self) -> None:
        try:
            data = self._require().recv(65536)
        except BlockingIOError:
            return
        except OSError as error:
            raise self._fail(GatewayUnavailable(f"{self.path}: the connection broke ({error})")) from None
        if not data:
            raise self._fail(GatewayUnavailable(f"{self.path}: the gateway closed the connection"))
        try:
            for message in self._wire.feed(data):
                self._sort(message)
        except ProtocolError as error:
            raise self._fail(error) from None

    def _sort(self, message: Message) -> None:
        if "ok" in message:
            if message.get("id") in self._wanted:
                self._replies[message["id"]] = message
            elif message.get("id") is None:  # too_many_clients, line_too_long: the gateway closes the connection next.
                raise self._fail(GatewayUnavailable(f"{self.path}: {message.get('error')}: {message.get('message')}"))
            return
        if message["event"] == "hello":
            self.hello = message
            return
        if self._latest and len(self.events) >= EVENTS_KEPT:
            self._leave_out()
        if len(self.events) >= EVENTS_KEPT:
            self.events.popleft()
            self._lost += 1
        self.events.append(cast(Event, message))


_alive: weakref.WeakSet[_Left] = weakref.WeakSet()


def ends_in_children(connection: _Left) -> None:
    """Registers a connection that a forked child must close. Otherwise the child would hold the parent's lease after the parent's death."""
    _alive.add(connection)


def _leave_all() -> None:
    for connection in list(_alive):
        connection.leave()


os.register_at_fork(after_in_child=_leave_all)
