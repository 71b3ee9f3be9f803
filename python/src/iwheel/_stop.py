# SPDX-License-Identifier: MIT
"""Sends a stop through a connection of its own, to whichever of the gateway's two sockets accepts it."""

from __future__ import annotations

import os
import socket
import time
from typing import Any
from collections.abc import Mapping

from ._errors import GatewayUnavailable, NoAnswer
from ._wire import WATCH_FOLDER, Message, Wire, cannot_connect

ATTEMPT_S = 0.3
"""Longest time of one attempt."""
AGAIN_S = 0.005


def other_socket(path: str) -> str:
    """Returns the gateway's other socket: watch/NAME.sock for NAME.sock, and the reverse."""
    folder, name = os.path.split(path)
    above, last = os.path.split(folder)
    return os.path.join(above, name) if last == WATCH_FOLDER else os.path.join(folder, WATCH_FOLDER, name)


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
