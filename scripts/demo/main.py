# SPDX-License-Identifier: MIT
"""The demonstration: the real gateway drives two simulated wheels, and everything told is checked. See ./demo --help."""

import argparse
import os
import signal
import sys

from cast import Sleeper
from harness import Rig, find_program
from screen import choose
from story import Failed, Story

# For any machine, however busy: the wheels are simulated by a process that may have to wait for its turn.
CONFIG = {"limits": {"wheel_silent_ms": 200, "echo_ms": 200}, "drive": {"lease_ms": 300}}
STALL_S = 0.1


def keep(rig):
    """Leaves everything running and says what to try."""
    tool = os.path.relpath(find_program(rig.build, "iwheelctl"))
    sim = os.path.relpath(find_program(rig.build, "iwheel-sim"))
    print(f"""
Gateway and simulator go on running. In another terminal, in this folder:

    export IWHEEL_SOCKET={rig.path('gateway.sock')}
    {tool} status
    {tool} drive 300 300 --for 3s
    {tool} watch state stop
    {tool} why

    SIM="{sim} --control {rig.path('control')}"
    $SIM estop press
    $SIM estop release
    {tool} reset
    $SIM help

Configuration:      {rig.path('gateway.conf')}
Gateway's messages: {rig.path('gateway.out')}
""")
    if sys.stdin.isatty():
        print("Enter or Ctrl-C ends both.", flush=True)
        sys.stdin.readline()
    else:
        print("Ctrl-C or SIGTERM ends both.", flush=True)
        signal.pause()


def parse():
    parser = argparse.ArgumentParser(prog="./demo")
    parser.add_argument("--build", required=True)
    parser.add_argument("--keep", action="store_true")
    parser.add_argument("--plain", action="store_true")
    return parser.parse_args()


def run(options):
    rig, sleeper = Rig(options.build, CONFIG), Sleeper()
    code = 0
    try:
        view = choose(sys.stdout, options.plain)
        story = Story(rig, view)
        try:
            story.tell()
        finally:
            view.close()
            for driver in story.drivers:
                driver.end()
        story.client.close()
        judge = story.judge()
        print(
            f"\nEverything happened as told, in {story.elapsed_s():.0f} s. {len(judge.frames)} frames were on the bus, {len(judge.setpoints)} of them\n"
            f"setpoints, judged one by one: no rule was broken; longest gap {judge.gap_max_us / 1000:.0f} ms."
        )
        if options.keep:
            keep(rig)
        else:
            print("Try it yourself: ./demo --keep")
    except Failed as failure:
        said = rig.gateway.text().splitlines()[-12:] if rig.gateway else []
        print("\nThe gateway's last words:\n" + "\n".join(said) + f"\n\nFAILED: {failure}", file=sys.stderr)
        if sleeper.worst_s > STALL_S:
            print(
                f"This machine was stalled for {sleeper.worst_s * 1000:.0f} ms meanwhile; try again when it is less busy.",
                file=sys.stderr,
            )
        code = 1
    finally:
        rig.close()
    return code


def main():
    options = parse()

    def interrupt(_number, _frame):
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, interrupt)
    signal.signal(signal.SIGHUP, interrupt)
    try:
        return run(options)
    except KeyboardInterrupt:
        print("ended")
        return 0 if options.keep else 130


if __name__ == "__main__":
    sys.exit(main())
