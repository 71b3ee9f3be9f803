# SPDX-License-Identifier: MIT
"""The end of a demonstration by a signal, and how to use it from another terminal."""

import os
import signal
import socket
import sys

from harness import find_program

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def end_with_signals(interrupted=128 + signal.SIGINT):
    """`interrupted`: exit status after Ctrl-C; 0 if that is the usual end. Ctrl-C, SIGTERM and a closed terminal raise SystemExit, so that `finally` ends all processes and removes all files. Only the first one counts."""

    def end(number, _frame):
        for one in ENDING:
            signal.signal(one, signal.SIG_IGN)
        sys.exit(interrupted if number == signal.SIGINT else 128 + number)

    for one in ENDING:
        signal.signal(one, end)


def require_free(ports, demo):
    """Ends the program if a port of this machine is in use, before anything starts."""
    for port in ports:
        with socket.socket() as one:
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                one.bind(("127.0.0.1", port))
            except OSError as error:
                sys.exit(f"demo: port {port} is not free ({error.strerror}); choose another one: ./demo {demo} --port N")


def other_terminal(rig):
    """Returns the commands with which another terminal drives these wheels."""
    tool = os.path.relpath(find_program(rig.build, "iwheelctl"))
    return f"""    export IWHEEL_SOCKET={rig.path("gateway.sock")}
    {tool} status
    {tool} drive 300 300 --for 3s
    {tool} watch state stop
    {tool} why
"""
