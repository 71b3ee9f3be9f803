# SPDX-License-Identifier: MIT
"""iwheelctl and the other programs of this build, as a user without own settings calls them."""

import os
import subprocess

from harness import STRANGER, find_program

BUILD = os.environ["IWHEEL_BUILD"]


def program(name="iwheelctl"):
    return find_program(BUILD, name)


def environment(*without, **more):
    """This process's, without the user's own settings and these variables, with these more."""
    dropped = ("IWHEEL_SOCKET", "NO_COLOR", *without)
    return {**{key: value for key, value in os.environ.items() if key not in dropped}, **more}


def start(*words, **more):
    """In the background; its output is discarded."""
    return subprocess.Popen([program(), *words], **{"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, **more})


def run_as_stranger(path, *words):
    """(exit code, stdout, stderr) of another user's process. It starts the program from an open descriptor, because that user may have no right to its path."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        user = {"user": STRANGER, "group": STRANGER, "extra_groups": [], "pass_fds": (descriptor,)}
        done = subprocess.run([f"/proc/self/fd/{descriptor}", *words], capture_output=True, text=True, check=False, **user)
    finally:
        os.close(descriptor)
    return done.returncode, done.stdout, done.stderr


def run(*words, name="iwheelctl", env=None, **more):
    """(exit code, stdout, stderr)"""
    more = {"timeout": 60, **({} if "input" in more else {"stdin": subprocess.DEVNULL}), **more}
    done = subprocess.run([program(name), *words], capture_output=True, text=True, check=False, env=env or environment(TERM="dumb"), **more)
    return done.returncode, done.stdout, done.stderr
