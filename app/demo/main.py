# SPDX-License-Identifier: MIT
"""The demonstration: the real gateway drives two simulated wheels, and each statement is checked. See ./demo --help."""

import signal

signal.signal(signal.SIGINT, signal.SIG_DFL)  # Until the first file and process exist, which must be removed again.

import argparse
import os
import sys

from cast import Sleeper
from ends import other_terminal
from harness import Rig, find_program
from screen import choose
from story import TOTAL, Failed, Story

# Wide limits for a busy machine, because the process that simulates the wheels may have to wait for the processor.
CONFIG = {"limits": {"wheel_silent_ms": 200, "echo_ms": 200}, "drive": {"lease_ms": 500, "max_speed_mm_s": 700}}
STALL_S, QUIET_S, AGAIN_S = 0.1, 0.005, 0.01


def serve(rig):
    """Leaves all processes running and prints commands to try."""
    sim = os.path.relpath(find_program(rig.build, "iwheel-sim"))
    print(f"""
Gateway and simulator continue to run. In another terminal, in this folder:

{other_terminal(rig)}
    SIM="{sim} --control {rig.path("control")}"
    $SIM estop press
    $SIM estop release
    {os.path.relpath(find_program(rig.build, "iwheelctl"))} reset
    $SIM help

Configuration:      {rig.path("gateway.conf")}
Gateway's messages: {rig.path("gateway.out")}
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


def show(story, view, sleeper, interrupts):
    try:
        with interrupts:
            story.run()
    finally:
        view.close()
        for driver in story.drivers:
            driver.end()
    story.client.close()
    judge = story.judge()
    late = [found for found in judge.found if found.timing]
    if late and not judge.bus_stalls() and sleeper.worst_s < QUIET_S:
        raise Failed(f"the judge of the bus log: {late[0].rule}: {late[0].text}")
    print(
        f"\nEvery step had the expected result, in {story.elapsed_s():.0f} s. {len(judge.frames)} frames were on the bus, "
        f"{len(judge.setpoints)} of them\nsetpoints, judged one by one: no rule was violated; "
        f"longest gap {judge.gap_max_us / 1000:.0f} ms."
        + (f"\n(Timing was not judged: this machine stalled for up to {sleeper.worst_s * 1000:.0f} ms.)" if late else "")
    )


def report(story, rig, error, sleeper):
    said = rig.gateway.text().splitlines()[-12:] if rig.gateway else []
    text = str(error) if isinstance(error, Failed) else f"{type(error).__name__}: {error}"
    print("\nThe gateway's last log lines:\n" + "\n".join(said), file=sys.stderr)
    print(f"\nFAILED in step {story.number} of {TOTAL}: {text}", file=sys.stderr)
    if sleeper.worst_s > STALL_S:
        stall_ms = sleeper.worst_s * 1000
        print(f"This machine was stalled for {stall_ms:.0f} ms meanwhile; try again when it is less busy.", file=sys.stderr)


class Interrupts:
    """Ctrl-C and the signals that end a program. Within `with` the first one raises KeyboardInterrupt. Outside it they wait, so that files
    and processes are created and removed completely."""

    def __init__(self):
        self.listens, self.came, self.pid = False, False, os.getpid()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGALRM):
            signal.signal(number, self.note)
        sys.unraisablehook = self.raise_again

    def note(self, _number, _frame):
        if os.getpid() != self.pid:  # A child before its exec.
            os._exit(130)
        self.came = True
        if self.listens:
            self.listens = False
            raise KeyboardInterrupt

    def raise_again(self, ignored):
        """Python ignores an exception in some of its callbacks, for example those of fork. An interrupt there is raised again by a timer."""
        if not isinstance(ignored.exc_value, KeyboardInterrupt):
            sys.__unraisablehook__(ignored)
            return
        self.listens = True
        signal.setitimer(signal.ITIMER_REAL, AGAIN_S)

    def __enter__(self):
        self.listens = True
        if self.came:
            self.listens = False
            raise KeyboardInterrupt

    def __exit__(self, *_):
        self.listens = False


def run(options, interrupts):
    try:
        rig = Rig(options.build, CONFIG)
    except (OSError, RuntimeError) as error:
        if interrupts.came:  # A terminal sends the signal to all processes: the simulator may have ended first.
            raise KeyboardInterrupt from error
        print(f"FAILED: the simulator does not start: {error}", file=sys.stderr)
        return 1
    sleeper = Sleeper()
    view = choose(sys.stdout, options.plain)
    story = Story(rig, view)
    try:
        show(story, view, sleeper, interrupts)
        if options.keep:
            with interrupts:
                serve(rig)
        else:
            print("Try it yourself: ./demo --keep")
        return 0
    except Exception as error:
        if interrupts.came:
            raise KeyboardInterrupt from error
        report(story, rig, error, sleeper)
        return 1
    finally:
        rig.close()


def main():
    options = parse()
    interrupts = Interrupts()
    try:
        return run(options, interrupts)
    except KeyboardInterrupt:
        print("ended")
        return 0 if options.keep else 130


if __name__ == "__main__":
    sys.exit(main())
