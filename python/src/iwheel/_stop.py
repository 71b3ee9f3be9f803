# SPDX-License-Identifier: MIT
"""Sends a stop through a connection of its own, to whichever of the gateway's two sockets accepts it."""

from __future__ import annotations

import contextlib
import os
import socket
import threading
import time
from typing import Any
from collections.abc import Callable, Mapping
from concurrent.futures import Future

from ._errors import GatewayUnavailable, NoAnswer
from ._wire import WATCH_FOLDER, Message, Wire, cannot_connect, default_sockets

ATTEMPT_S = 0.3
"""Longest time of one attempt."""
AGAIN_S = 0.005
STOP_AGAIN_S = 0.05
"""Time between two attempts while a client waits for a gateway that is not running yet."""


def other_socket(path: str) -> str:
    """Returns the gateway's other socket: watch/NAME.sock for NAME.sock, and the reverse."""
    folder, name = os.path.split(path)
    above, last = os.path.split(folder)
    return os.path.join(above, name) if last == WATCH_FOLDER else os.path.join(folder, WATCH_FOLDER, name)


def in_own_thread(call: Callable[[], Message]) -> Future[Message]:
    """Calls in a thread of its own, because the threads of an executor may all be occupied; in this thread if no other can start. Nothing cancels it."""
    future: Future[Message] = Future()
    future.set_running_or_notify_cancel()

    def run() -> None:
        try:
            future.set_result(call())
        except BaseException as error:  # noqa: BLE001 (the caller receives it)
            future.set_exception(error)

    try:
        threading.Thread(target=run, name="iwheel stop").start()
    except RuntimeError:
        run()
    return future


def stop_apart(path: str | None, cmd: str, fields: Mapping[str, Any], timeout: float) -> Message:
    """Sends a stop through connections of its own: to that socket, or to all default ones. Returns the reply of a gateway that executed it.

    Sends the line to all of them before it waits for the first reply, so a hung gateway delays no other.
    """
    paths = [path] if path else default_sockets()
    replies: list[Message] = []
    errors: list[GatewayUnavailable] = []
    with contextlib.ExitStack() as early:
        for one in paths if len(paths) > 1 else []:
            with contextlib.suppress(OSError):
                _post(early.enter_context(socket.socket(socket.AF_UNIX)), one, cmd, fields)
        for one in paths:
            try:
                replies.append(stop_by_either(one, cmd, fields, timeout))
            except GatewayUnavailable as error:
                errors.append(error)
    if not replies:
        raise errors[0]
    return next((reply for reply in replies if reply["ok"] is True), replies[0])


def _post(one: socket.socket, path: str, cmd: str, fields: Mapping[str, Any]) -> None:
    one.setblocking(False)
    one.connect(path)
    one.sendall(Wire().request(cmd, fields)[1])


def stop_by_either(path: str, cmd: str, fields: Mapping[str, Any], timeout: float) -> Message:
    """Returns the reply to `stop` or `estop`. It sends the line immediately after connecting: a gateway with its maximum of clients sends no greeting,
    but executes the stop.

    Tries both sockets until the time is over. GatewayUnavailable states the problem with `path`.
    """
    deadline = time.monotonic() + timeout
    first: GatewayUnavailable | None = None
    while True:
        passing = False
        for one in (path, other_socket(path)):
            try:
                return _attempt(one, cmd, fields, max(AGAIN_S, min(ATTEMPT_S, deadline - time.monotonic())))
            except GatewayUnavailable as error:
                first = first or error
                passing = passing or not isinstance(error.__cause__, (FileNotFoundError, ConnectionRefusedError, PermissionError))
        if first is not None and (not passing or time.monotonic() > deadline):
            raise first
        time.sleep(AGAIN_S)


def _attempt(path: str, cmd: str, fields: Mapping[str, Any], timeout: float) -> Message:
    wire, deadline = Wire(), time.monotonic() + timeout
    number, line = wire.request(cmd, fields)
    with socket.socket(socket.AF_UNIX) as one:
        try:
            one.settimeout(timeout)
            one.connect(path)
            one.sendall(line)
            while True:
                one.settimeout(max(0.001, deadline - time.monotonic()))
                data = one.recv(65536)
                if not data:
                    raise GatewayUnavailable(f"{path}: the gateway closed the connection")
                for message in wire.feed(data):
                    if message.get("id") == number and "ok" in message and message.get("error") != "too_many_clients":
                        return message
                    if message.get("error") == "too_many_clients":
                        raise GatewayUnavailable(f"{path}: too_many_clients: {message.get('message')}")
        except (TimeoutError, BlockingIOError) as error:
            raise NoAnswer(f"{path}: no answer to {cmd} within {timeout:g} s") from error
        except OSError as error:
            raise cannot_connect(path, error) from error
