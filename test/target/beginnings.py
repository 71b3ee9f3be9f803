# SPDX-License-Identifier: MIT
"""What many scenarios begin with, a start of the image until it drives, is run once for each image: every scenario goes on from there in a
process of its own, a copy of the one that ran it, emulated CPU and all. Nothing of that differs from a run from power-on, whose every
cycle is the same each time.
"""

import functools
import os
import pickle


class Found(Exception):
    """The beginning, as (function, arguments), or None."""


class Nothing:
    """Replaces a rig: reports which use a scenario makes of it first."""

    def __getattr__(self, name):
        raise Found(None)


def shared(function):
    """Marks a function of the rig with which a scenario may begin. In a copy it returns what it returned before the copy was made."""

    @functools.wraps(function)
    def begin(rig, *arguments):
        if isinstance(rig, Nothing):
            raise Found((begin, arguments))
        if rig.begun is None:
            return function(rig, *arguments)
        (was, result), rig.begun = rig.begun, None
        assert was == (begin, arguments), "the scenario does not begin as it was found to"
        return result

    return begin


def of(scenario):
    """With what it begins: (function, arguments), or None if with something of its own."""
    try:
        scenario(Nothing())
    except Found as found:
        return found.args[0]
    raise TypeError(f"{scenario.__name__} does nothing with its rig")


def run(rig, beginning):
    if beginning is not None:
        function, arguments = beginning
        rig.begun = beginning, function(rig, *arguments)


def apart(function, *arguments):
    """What the function returns in a copy of this process."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            with os.fdopen(writing, "wb") as pipe:
                pickle.dump(function(*arguments), pipe)
        finally:
            os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as pipe:
        sent = pipe.read()
    os.waitpid(child, 0)
    return pickle.loads(sent) if sent else None
