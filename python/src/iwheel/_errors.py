# SPDX-License-Identifier: MIT
"""What can go wrong. All of it is an IWheelError; none of it leaves a wheel turning."""

from __future__ import annotations


class IWheelError(Exception):
    """The base of everything this package raises, beside programming errors."""


class GatewayUnavailable(IWheelError):
    """There is no connection: nobody listens, no rights, or the gateway has closed it."""


class NoAnswer(GatewayUnavailable):
    """The gateway did not answer in time. The connection was closed, so the lease has ended."""


class ProtocolError(GatewayUnavailable):
    """What came is not the northbound protocol, or a newer one than this package speaks. The connection was closed."""


class LeaseEnded(IWheelError):
    """This permission to drive is over. Look why (`Gateway.why()`), then `arm()` again if that is what is wanted.

    `error`: the name of the refusal by which the gateway told it (`not_armed`, `latched` ...); None if it was known without asking.
    """

    def __init__(self, message: str, error: str | None = None) -> None:
        super().__init__(message)
        self.error = error


class ConnectionLost(LeaseEnded, GatewayUnavailable):
    """The gateway has closed the connection, and with it the permission to drive ended."""


class Refused(IWheelError):
    """The gateway said no; nothing was applied.

    `error` is a name of the closed list in docs/user/northbound.md, `message` tells cause and cure, `cmd` what was asked.
    """

    def __init__(self, cmd: str, error: str, message: str) -> None:
        super().__init__(f"{cmd} refused ({error}): {message}")
        self.cmd = cmd
        self.error = error
        self.message = message
