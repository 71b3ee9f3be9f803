# SPDX-License-Identifier: MIT
"""The errors of this package. All derive from IWheelError. After each of them the wheels stop."""

from __future__ import annotations


class IWheelError(Exception):
    """Base class of all errors of this package, except programming errors."""


class GatewayUnavailable(IWheelError):
    """There is no connection: no program listens, this user has no rights, or the gateway has closed it."""


class NoAnswer(GatewayUnavailable):
    """The gateway did not reply in time. This package has closed the connection, so the lease has ended."""


class ProtocolError(GatewayUnavailable):
    """The peer does not use the northbound protocol, or a newer version than this package supports. This package has closed the connection."""


class LeaseEnded(IWheelError):
    """This permission to drive is over. Read the reason (`Gateway.why()`), then call `arm()` again to drive on.

    `error`: the name of the gateway's refusal (`not_armed`, `latched` ...); None if the end was known without a request.
    """

    def __init__(self, message: str, error: str | None = None) -> None:
        super().__init__(message)
        self.error = error


class ConnectionLost(LeaseEnded, GatewayUnavailable):
    """The gateway has closed the connection, which ended the permission to drive."""


class Refused(IWheelError):
    """The gateway refused a request and applied nothing.

    `error` is a name of the closed list in docs/user/northbound.md, `message` states cause and fix, `cmd` is the request.
    """

    def __init__(self, cmd: str, error: str, message: str) -> None:
        super().__init__(f"{cmd} refused ({error}): {message}")
        self.cmd = cmd
        self.error = error
        self.message = message
