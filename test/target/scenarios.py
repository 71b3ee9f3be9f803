# SPDX-License-Identifier: MIT
"""The required behaviour of the image in all situations. Each scenario is a function of a `Rig`; an AssertionError is a failure.

The bus, the lamp and the count of resets are judged: everything that is visible from outside.
"""

import itertools
import re

import beginnings
import gateway_scenarios
import host
from emulator.can import LEFT, RIGHT, Frame
from emulator.chip import MS, PINRSTF, US

SECOND = 1000 * MS
ZERO = (0, 2000)  # Role "limit": zero speed with the configured maximum current.
EDGE_TO_ZERO_NS = 5 * MS
LISTENING, NO_BUS, NO_CRYSTAL = "1 flashes, 6.25 % lit", "2 flashes, 12.5 % lit", "3 flashes, 18.75 % lit"
ARMED, ESTOP, LATCHED = "steady", "1 flashes, 50 % lit", "2 flashes, 50 % lit"


def assert_zero(frames):
    for frame in frames:
        assert frame.setpoint() == ZERO, f"{frame.id} has {frame.setpoint()} at {frame.time_ns / MS:.3f} ms"


def assert_pairs(frames):
    """Left and right alternate, the right one within a millisecond."""
    for left, right in zip(frames[0::2], frames[1::2], strict=False):
        assert (left.id, right.id) == (LEFT, RIGHT), f"no pair at {left.time_ns / MS:.3f} ms"
        assert right.time_ns - left.time_ns < MS, f"the right setpoint is late at {right.time_ns / MS:.3f} ms"
    for frame in frames:
        assert len(frame.data) == 5 and frame.data[0] == 1, f"not the configured form: {frame}"


def assert_gaps(frames, longest_ns, side=LEFT):
    times = [frame.time_ns for frame in frames if frame.id == side]
    worst = max((b - a for a, b in itertools.pairwise(times)), default=0)
    assert times and worst <= longest_ns, f"a gap of {worst / MS:.1f} ms between setpoints"


def assert_lamp(rig, pattern):
    seen = rig.machine.lamp.pattern(rig.machine.now_ns)
    assert seen == pattern, f"the lamp shows {seen}, not {pattern}"


def assert_lamp_steady_since(rig, span_ns):
    changes = rig.machine.lamp.changes
    assert changes[-1][1] and rig.machine.now_ns - changes[-1][0] >= span_ns, "not armed any more"


@beginnings.shared
def arm(rig, within_ns=SECOND):
    rig.run(within_ns)
    frames = rig.setpoints()
    assert len(frames) >= 4, "not armed"
    assert_zero(frames)
    assert_pairs(frames)


def assert_held_then_silent(rig, since_ns, hold_ns=1475 * MS):
    """Zeros for the hold, then nothing until the end of the run."""
    frames = rig.setpoints(since_ns)
    assert_zero(frames)
    assert frames and frames[-1].time_ns - since_ns >= hold_ns, "the zeros were not held"
    assert rig.machine.now_ns - frames[-1].time_ns > 300 * MS, "setpoints after the hold"


def assert_zeros_first(rig, since_ns):
    """After a start or a return of the board at that time: zeros soon, and nothing else."""
    frames = rig.setpoints(since_ns)
    assert frames and frames[0].time_ns - since_ns < 300 * MS, "no zeros first"
    assert_zero(frames)


def press_button(rig, span_ns=60 * MS):
    rig.machine.board.drive("button", 0)
    rig.run(span_ns)
    rig.machine.board.drive("button", None)


def reset_and_arm(rig):
    press_button(rig)
    rig.run(SECOND)
    assert_lamp(rig, ARMED)


@beginnings.shared
def start_demo(rig):
    arm(rig)
    press_button(rig)
    rig.run(600 * MS)
    assert rig.setpoints()[-1].setpoint()[0] == 100, "the profile did not start"


def nominal(rig):
    """Arms, sends both zeros every 20 ms at exactly 1 Mbit/s and 62.5 %."""
    arm(rig)
    rig.run(2 * SECOND)
    frames = rig.setpoints(SECOND)
    assert_zero(frames)
    assert_pairs(frames)
    assert_gaps(frames, 22 * MS)
    assert 49 <= len(frames) / 4 <= 51, f"{len(frames)} setpoints in 2 s, not 200"
    assert rig.machine.can.timing() == (1_000_000, 625), rig.machine.can.timing()
    assert_lamp(rig, ARMED)
    rig.note(f"CPU {rig.machine.busy_ns * 100 / rig.machine.now_ns:.1f} % busy, {rig.stack_used()} B of stack used")


def usb_pins(rig):
    """The transceiver is on PA11 and PA12, and the image made for that."""
    nominal(rig)


def other_crystal(rig):
    """A crystal of another frequency, and the image made for that: the bus is as exact."""
    nominal(rig)
    assert str(rig.machine.clocks.crystal_hz // 1000) + " kHz" in rig.console()[0], rig.console()


def listening(rig):
    """Without setpoint type and role, the board receives everything, sends nothing and acknowledges nothing."""
    rig.run(2 * SECOND)
    assert not rig.setpoints() and rig.machine.bus.attempts == 0
    assert rig.machine.can.is_silent(), "the controller is not in silent mode"
    assert rig.machine.can.timing() == (1_000_000, 625)
    assert rig.counter("received") > 1000, f"only {rig.counter('received')} frames received"
    assert_lamp(rig, LISTENING)


def setpoint_role(rig):
    """Where the current is a setpoint: zero is 0/0, with the configured type."""
    rig.run(2 * SECOND)
    frames = rig.setpoints(SECOND)
    assert_gaps(frames, 22 * MS)
    assert {frame.data for frame in rig.setpoints()} == {bytes([255, 0, 0, 0, 0])}, "not 255 0 0"
    assert_lamp(rig, ARMED)


def clock_input(rig):
    """A clock signal instead of a crystal: the board runs from it, exactly; without it the lamp shows it; it arms when the signal comes."""
    clocks = rig.machine.clocks
    clocks.is_clock = True
    clocks.set_crystal(False)
    rig.run(1200 * MS)
    assert_lamp(rig, NO_CRYSTAL)
    clocks.set_crystal(True)
    arm(rig)
    assert rig.machine.can.timing() == (1_000_000, 625), rig.machine.can.timing()


def power_wheels(rig, is_on):
    for wheel in rig.machine.bus.wheels:
        wheel.power(is_on, rig.machine.now_ns)


def fast_watchdog(rig):
    """The watchdog's oscillator at its fastest: still no reset, also while no frame wakes the loop."""
    power_wheels(rig, False)
    rig.run(500 * MS)
    power_wheels(rig, True)
    arm(rig)


def passes_wrap(rig, wrap_ms):
    """Time is set to 600 ms before, at the start; then the other way round nothing may be seen of it."""
    while not 1 <= rig.peek("ticks_ms") < 4:  # Before, RAM has not been cleared yet.
        rig.run(50 * US)
    rig.poke("ticks_ms", wrap_ms - 600)
    rig.poke("ticks_slept", wrap_ms - 600)
    arm(rig)
    rig.run(SECOND)
    assert_gaps(rig.setpoints(100 * MS), 22 * MS)
    assert_lamp_steady_since(rig, SECOND)
    assert rig.machine.call(rig.function("brd_time_now_us")) > wrap_ms * 1000, "time has wrapped"


def time_passes_32_bits_of_microseconds(rig):
    """After 71 minutes nothing happens."""
    passes_wrap(rig, (1 << 32) // 1000)


def time_passes_32_bits_of_milliseconds(rig):
    """After 49 days nothing happens."""
    passes_wrap(rig, 1 << 32)


def time_never_goes_back(rig):
    """Asked at every cycle around a tick, the time only grows, and by as much as has passed."""
    arm(rig)
    machine, now_us = rig.machine, rig.function("brd_time_now_us")
    last_us, offset_us = 0, None
    for early_ns in range(0, 1500, 10):
        machine.run(machine.tick_ns - machine.now_ns - early_ns)
        for _ in range(3):
            before_us, board_us = machine.now_ns / US, machine.call(now_us)
            assert board_us >= last_us, f"{board_us} us after {last_us} us"
            offset_us = offset_us or board_us - before_us
            # The first one is read right at a tick, behind its interrupt: up to 3 us later than the others.
            assert -3 <= board_us - before_us - offset_us <= 5, f"{board_us} us, {before_us + offset_us} us have passed"
            last_us = board_us


def estop(rig):
    """Pressed while armed: a zero within 5 ms, held, then no setpoints, also after the release."""
    arm(rig)
    rig.run(7_300 * US)
    pressed_ns = rig.open_estop()
    rig.run(2500 * MS)
    first = rig.setpoints(pressed_ns)[0]
    assert first.time_ns - pressed_ns <= EDGE_TO_ZERO_NS, f"first setpoint {(first.time_ns - pressed_ns) / MS:.3f} ms after the edge"
    assert_held_then_silent(rig, pressed_ns)
    assert_lamp(rig, ESTOP)
    rig.close_estop()
    rig.run(1500 * MS)
    assert_held_then_silent(rig, pressed_ns)
    assert_lamp(rig, LATCHED)


def estop_pulse(rig):
    """Open for 1 us, which is too short to read the level: latched."""
    arm(rig)
    pressed_ns = rig.open_estop()
    rig.run(1 * US)
    rig.close_estop()
    rig.run(2500 * MS)
    assert_held_then_silent(rig, pressed_ns)
    assert_lamp(rig, LATCHED)


def estop_wakes(rig):
    """The button is pressed while nothing else wakes the loop: the edge wakes it, and zeros leave immediately."""
    arm(rig)
    machine = rig.machine
    for _ in range(1000):
        since_pair_ns = machine.now_ns - rig.setpoints()[-1].time_ns
        quiet_ns = min(wheel.next_ns for wheel in machine.bus.wheels) - machine.now_ns
        if machine.bus.current is None and quiet_ns > 1700 * US and 2 * MS < since_pair_ns < 15 * MS:
            break
        rig.run(37 * US)
    pressed_ns = rig.open_estop()
    rig.run(20 * MS)
    first = rig.setpoints(pressed_ns)[0]
    assert first.time_ns - pressed_ns < 700 * US, f"first zero {(first.time_ns - pressed_ns) / MS:.3f} ms after the edge"


def estop_chatters(rig):
    """The contact opens and closes every 50 us for 100 ms: latched, and neither the bus nor the watchdog notices."""
    arm(rig)
    since_ns = rig.machine.now_ns
    for _ in range(1000):
        rig.open_estop()
        rig.run(50 * US)
        rig.close_estop()
        rig.run(50 * US)
    assert_gaps(rig.setpoints(since_ns - 30 * MS), 25 * MS)
    rig.run(2500 * MS)
    assert_held_then_silent(rig, since_ns)
    assert_lamp(rig, LATCHED)


def estop_at_start(rig):
    """Pressed before power comes: nothing is sent, not after the release either."""
    rig.open_estop()
    rig.run(1200 * MS)
    assert_lamp(rig, ESTOP)
    rig.close_estop()
    rig.run(1200 * MS)
    assert_lamp(rig, LATCHED)
    assert not rig.setpoints() and rig.machine.bus.attempts == 0


def reset_by_button(rig):
    """Without a host the button resets a latch: refused while pressed; then the board arms with zeros. The console reports it."""
    arm(rig)
    pressed_ns = rig.open_estop()
    rig.run(300 * MS)
    press_button(rig)
    rig.run(500 * MS)
    assert "reset refused: the e-stop is pressed" in rig.console(), rig.console()
    rig.close_estop()
    rig.run(2 * SECOND)
    assert_lamp(rig, LATCHED)
    assert "then press the button on PA1" in rig.console()[-2], rig.console()
    silent_ns = rig.machine.now_ns
    rig.run(300 * MS)
    assert not rig.setpoints(silent_ns)
    press_button(rig)
    rig.run(1200 * MS)
    assert "reset done" in rig.console(), rig.console()
    assert_lamp(rig, ARMED)
    assert_zero(rig.setpoints(pressed_ns))


def reset_while_listening(rig):
    """The image that listens only: a latch is reset by the button, and nothing is sent."""
    rig.run(500 * MS)
    rig.open_estop()
    rig.run(300 * MS)
    rig.close_estop()
    rig.run(1500 * MS)
    assert_lamp(rig, LATCHED)
    press_button(rig)
    rig.run(1200 * MS)
    assert_lamp(rig, LISTENING)
    assert rig.machine.bus.attempts == 0


def console(rig):
    """The first line has version, clock, pins, bit timing, e-stop; each change has a line; a typed character repeats both."""
    rig.run(1500 * MS)
    machine, lines = rig.machine, rig.console()
    printed = re.fullmatch(
        r"iwheel \d+\.\d+\.\d+ on (\w+) \([\w ]+\): clock (\d+) MHz from a crystal of (\d+) kHz; CAN on (?:PB8 PB9|PA11 PA12) at (\d+) bit/s, "
        r"sampled at 62\.5 %, (?:BTR|NBTP) 0x([0-9A-F]{8}); e-stop on PB0: released; holds both wheels at zero",
        lines[0],
    )
    assert printed, lines[0]
    facts = (machine.board.name.upper(), machine.clocks.core_hz // 10**6, machine.clocks.crystal_hz // 1000, 10**6, machine.can.read(0x1C))
    assert (printed[1], *map(int, printed.groups()[1:4]), int(printed[5], 16)) == facts, (printed.groups(), facts)
    assert lines[-2:] == ["armed; bus active; e-stop released", ""], lines
    machine.uart.send(b"?")
    rig.run(500 * MS)
    assert rig.console()[len(lines) - 1 :] == [lines[0], lines[-2], ""], rig.console()
    rig.open_estop()
    rig.run(300 * MS)
    assert rig.console()[-2].startswith("latched by estop_line; bus active; e-stop pressed; to reset: "), rig.console()
    assert_gaps(rig.setpoints(100 * MS), 22 * MS)


def wheel_missing(rig):
    """One wheel only: nothing is sent. When the other one comes, it arms."""
    rig.machine.bus.wheels[1].power(False, 0)
    rig.run(1500 * MS)
    assert rig.machine.bus.attempts == 0, "armed with one wheel"
    assert_lamp(rig, LISTENING)
    rig.machine.bus.wheels[1].power(True, rig.machine.now_ns)
    arm(rig)


def wheel_lost(rig):
    """A wheel without power while armed: zeros for at most a minute, then no setpoints, and no arming when it returns."""
    arm(rig)
    lost_ns = rig.machine.now_ns
    rig.machine.bus.wheels[0].power(False, lost_ns)
    rig.run(60_600 * MS)
    assert_held_then_silent(rig, lost_ns, 59_900 * MS)
    rig.machine.bus.wheels[0].power(True, rig.machine.now_ns)
    rig.run(SECOND)
    assert_held_then_silent(rig, lost_ns, 59_900 * MS)


def no_acknowledgement(rig):
    """No node acknowledges: not armed, not bus-off, no hang. With acknowledgements at most the pair that was just asked for leaves, and it
    arms."""
    rig.machine.bus.acknowledge_chip = False
    rig.run(500 * MS)
    assert rig.machine.bus.attempts > 0 and not rig.setpoints()
    assert rig.machine.can.is_on(), "bus-off, because nothing acknowledges"
    rig.machine.bus.acknowledge_chip = True
    back_ns = rig.machine.now_ns
    rig.run(SECOND)
    waited = rig.setpoints(back_ns, back_ns + 5 * MS)
    assert_zero(rig.setpoints())
    assert len(waited) <= 2, f"{len(waited)} stale setpoints"
    armed = rig.setpoints(back_ns + 50 * MS)
    assert len(armed) > 50, "not armed"
    assert_pairs(armed)


def acknowledgement_lost(rig):
    """In motion no node acknowledges for 300 ms: latched, and frames that waited then are never sent."""
    start_demo(rig)
    rig.machine.bus.acknowledge_chip = False
    lost_ns = rig.machine.now_ns
    rig.run(300 * MS)
    rig.machine.bus.acknowledge_chip = True
    rig.run(2500 * MS)
    assert_zero(rig.setpoints(lost_ns + MS))
    assert rig.counter("purges") >= 1
    assert_lamp(rig, LATCHED)


def silence_is_silent(rig):
    """In motion no node acknowledges, and after the hold the wheels lose power: nothing more is sent, also not when the power returns
    after 20 s. Reset, arming and a new press are needed."""
    start_demo(rig)
    bus = rig.machine.bus
    bus.acknowledge_chip = False
    rig.run(5 * SECOND)
    attempts = bus.attempts
    power_wheels(rig, False)
    rig.run(15 * SECOND)
    assert bus.attempts == attempts, f"{bus.attempts - attempts} attempts after the last zero"
    bus.acknowledge_chip = True
    back_ns = rig.machine.now_ns
    power_wheels(rig, True)
    rig.run(2 * SECOND)
    assert not rig.setpoints(back_ns), f"{len(rig.setpoints(back_ns))} frames left by themselves"
    assert_lamp(rig, LATCHED)
    reset_and_arm(rig)
    assert_zero(rig.setpoints(back_ns))


def abort_without_end(rig):
    """In motion no node acknowledges, and the controller does not end the abort: it is reset, and no old frame is sent."""
    start_demo(rig)
    rig.machine.can.slow_aborts(0xFFFFFFFF)
    rig.machine.bus.acknowledge_chip = False
    lost_ns = rig.machine.now_ns
    rig.run(300 * MS)
    assert rig.counter("resets") >= 1, "the controller was not reset"
    rig.machine.bus.acknowledge_chip = True
    rig.run(2500 * MS)
    assert_zero(rig.setpoints(lost_ns + MS))
    assert_lamp(rig, LATCHED)
    reset_and_arm(rig)


def bus_off(rig):
    """In motion the bus goes off: recovered, zeros first, and motion only after a reset, a new arming and a new press."""
    start_demo(rig)
    rig.machine.bus.corrupt_chip = True
    off_ns = rig.machine.now_ns
    rig.run(30 * MS)
    rig.machine.bus.corrupt_chip = False
    assert rig.counter("bus_offs") >= 1, "no bus-off"
    rig.run(2500 * MS)
    assert rig.machine.can.is_on(), "not recovered"
    assert rig.setpoints(off_ns), "no zeros after recovery"
    assert_zero(rig.setpoints(off_ns))
    assert_lamp(rig, LATCHED)
    reset_ns = rig.machine.now_ns
    press_button(rig)
    rig.run(SECOND)
    assert rig.setpoints(reset_ns), "not armed again"
    assert_zero(rig.setpoints(reset_ns))
    press_button(rig)
    rig.run(500 * MS)
    assert rig.setpoints()[-1].setpoint()[0] > 0, "no motion after reset, arming and a new press"


def stuck_at_start(rig):
    """The bus is dominant from the start: the board does not hang, the lamp shows it, and it arms when the bus is recessive again."""
    rig.machine.bus.hold_dominant(True)
    rig.run(2 * SECOND)
    assert_lamp(rig, NO_BUS)
    rig.machine.bus.hold_dominant(False)
    arm(rig, 1500 * MS)


def open_at_start(rig):
    """The bus is not connected when power comes, wherever it is open: no hang, nothing is sent; connected later, it arms."""
    for where in ("cable", "receiver"):
        rig.machine.bus.cut_off(where)
        rig.run(1200 * MS)
        assert rig.machine.bus.attempts == 0, "it sent"
        assert_lamp(rig, LISTENING)
    rig.machine.bus.cut_off(None)
    arm(rig)


def torn(rig, where, bus_offs):
    start_demo(rig)
    torn_ns = rig.machine.now_ns
    rig.machine.bus.cut_off(where)
    rig.run(500 * MS)
    assert not rig.setpoints(torn_ns + MS), "setpoints through a cut"
    assert rig.counter("bus_offs") >= bus_offs, "no bus-off"
    rig.machine.bus.cut_off(None)
    rig.run(2500 * MS)
    assert rig.machine.can.is_on(), "not recovered"
    assert_zero(rig.setpoints(torn_ns + MS))
    assert_lamp(rig, LATCHED)
    press_button(rig)
    rig.run(SECOND)
    assert_zero(rig.setpoints(torn_ns + MS))
    press_button(rig)
    rig.run(500 * MS)
    assert rig.setpoints()[-1].setpoint()[0] == 100, "no motion after reset, arming and a new press"


def cable_torn(rig):
    """In motion the cable is torn off beyond the transceiver: latched, nothing old afterwards, and no motion without a new request."""
    torn(rig, "cable", 0)


def receiver_open(rig):
    """In motion the wire of the received signal breaks: bus-off repeatedly, zeros when it is whole, and no motion without a new request."""
    torn(rig, "receiver", 2)


def stuck_in_motion(rig):
    """The bus is held dominant for 300 ms in the middle of a setpoint: bus-off, latched, nothing stale afterwards."""
    start_demo(rig)
    bus = rig.machine.bus
    while bus.current is None or bus.current[1] is None:
        rig.run(20 * US)
    stuck_ns = rig.machine.now_ns
    bus.hold_dominant(True)
    rig.run(300 * MS)
    assert rig.counter("bus_offs") >= 1, "no bus-off"
    rig.machine.bus.hold_dominant(False)
    rig.run(2500 * MS)
    assert_zero(rig.setpoints(stuck_ns))
    assert_lamp(rig, LATCHED)


def full_bus(rig):
    """Another node fills the bus with short frames of an accepted id: none is lost, and setpoints are still sent."""
    arm(rig)
    bus, start_ns, flooded = rig.machine.bus, rig.machine.now_ns, rig.machine.bus.flooded
    before = rig.counter("bad_format")
    bus.flood = Frame(545, b"", sender="flood", remote_dlc=3)  # 47 bits with the space: none is shorter.
    rig.run(500 * MS)
    bus.flood = None
    rig.run(50 * MS)
    frames = bus.flooded - flooded
    total = 2 * sum(1 for frame in bus.log if start_ns <= frame.time_ns < start_ns + 500 * MS)
    assert total >= 20_500, f"the bus was not full: {total} frames/s"
    assert rig.machine.can.overruns() == 0 and rig.counter("overruns") == 0, "the controller's FIFO overran"
    assert rig.counter("lost") == 0, f"{rig.counter('lost')} frames were lost"
    assert rig.counter("bad_format") - before == frames, f"{rig.counter('bad_format') - before} of {frames} frames were accepted"
    assert_gaps(rig.setpoints(start_ns), 25 * MS)
    assert_zero(rig.setpoints(start_ns))
    rig.note(f"{total} frames/s")


def overrun(rig):
    """The CPU is held up for 2 ms on a full bus: the controller overruns, the core receives it, and nothing else happens."""
    arm(rig)
    rig.machine.bus.flood = Frame(545, b"", sender="flood", remote_dlc=3)
    rig.run(20 * MS)
    before = rig.counter("unknown")
    rig.machine.frozen = True
    rig.run(2 * MS)
    rig.machine.frozen = False
    rig.run(20 * MS)
    rig.machine.bus.flood = None
    assert rig.machine.can.overruns() >= 30, "the emulated controller did not overrun"
    assert rig.counter("overruns") >= 1 and rig.counter("unknown") == before + 1, "the core received no overrun, or too many"
    rig.run(300 * MS)
    assert_lamp_steady_since(rig, 250 * MS)


def babbling(rig):
    """Another node fills the bus with an id below the setpoints': latched, because nothing is sent; zeros after it stops."""
    start_demo(rig)
    since_ns = rig.machine.now_ns
    rig.machine.bus.flood = Frame(1, bytes(8), sender="flood")
    rig.run(200 * MS)
    rig.machine.bus.flood = None
    rig.run(2 * SECOND)
    assert_zero(rig.setpoints(since_ns + MS))
    assert_lamp(rig, LATCHED)


def second_master(rig):
    """A setpoint of another node: latched."""
    arm(rig)
    rig.machine.bus.extra.append(Frame(RIGHT, bytes([1, 0, 0, 0, 0]), sender="master"))
    since_ns = rig.machine.now_ns
    rig.run(2500 * MS)
    assert_held_then_silent(rig, since_ns)
    assert_lamp(rig, LATCHED)


def no_crystal(rig):
    """No crystal: the board sends nothing, the lamp shows it, no reset; when the crystal runs, the board arms."""
    rig.machine.clocks.set_crystal(False)
    rig.run(1200 * MS)
    assert_lamp(rig, NO_CRYSTAL)
    assert not rig.machine.can.is_on() and rig.machine.bus.attempts == 0
    khz = rig.machine.clocks.crystal_hz // 1000
    assert rig.console() == [f"no crystal of {khz} kHz yet: the bus is left alone until it runs", ""], rig.console()
    rig.machine.clocks.set_crystal(True)
    arm(rig)


def slow_crystal(rig):
    """The board waits for a crystal that needs 45 ms, and does not restart it repeatedly."""
    rig.machine.clocks.start_ns = 45 * MS
    arm(rig)
    assert rig.machine.can.timing() == (1_000_000, 625), rig.machine.can.timing()


def crystal_dies(rig):
    """The crystal fails in motion: off the bus immediately; when it runs again, zeros first, and no motion without a new request."""
    start_demo(rig)
    died_ns = rig.machine.now_ns
    rig.machine.clocks.set_crystal(False)
    rig.run(500 * MS)
    assert not list(rig.setpoints(died_ns + 2 * MS)), "it went on sending"
    rig.machine.clocks.set_crystal(True)
    back_ns = rig.machine.now_ns
    rig.run(3 * SECOND)
    assert_zeros_first(rig, back_ns)
    rig.expect_resets("software")


def assert_watchdog_resets(rig, since_ns):
    rig.run(300 * MS)
    rig.expect_resets("watchdog")
    assert rig.machine.resets, "the watchdog did not reset the chip"
    assert rig.machine.resets[0][0] - since_ns < 200 * MS, "the watchdog was too late"


def hang(rig):
    """The CPU hangs in motion: the watchdog, however slow its oscillator, restarts the board with zeros."""
    start_demo(rig)
    hung_ns = rig.machine.now_ns
    rig.machine.frozen = True
    assert_watchdog_resets(rig, hung_ns)
    rig.run(3 * SECOND)
    assert_zeros_first(rig, rig.machine.resets[0][0])


def reset_again(rig):
    """In motion the chip is reset, and at any instant of the next 100 ms once more: zeros follow, each time."""
    start_demo(rig)
    machine, last_ns = rig.machine, rig.machine.now_ns
    instants = [*range(0, 8_000, 250), *range(8_000, 100_000, 4_000)]
    for instant_us in instants:
        for span_ns in (instant_us * US, 100 * MS):
            last_ns = machine.now_ns
            machine.reset("pin", PINRSTF)
            rig.run(max(span_ns, US))
        frames = rig.setpoints(last_ns)
        assert len(frames) >= 2, f"no zeros after a second reset {instant_us} us after the first"
        assert_zero(frames)
    rig.expect_resets(*["pin"] * (2 * len(instants)))
    rig.run(3 * SECOND)
    assert_lamp(rig, ARMED)
    machine.reset("pin", PINRSTF)
    rig.expect_resets(*["pin"] * (2 * len(instants) + 1))


def reset_after_the_hold(rig):
    """A stop that was acknowledged is over: the run after it listens before it arms."""
    start_demo(rig)
    rig.open_estop()
    rig.run(2500 * MS)
    machine = rig.machine
    machine.reset("pin", PINRSTF)
    reset_ns = machine.now_ns
    rig.run(SECOND)
    rig.expect_resets("pin")
    assert not rig.setpoints(reset_ns), "zeros although the wheels have long been stopped"


def reset_after_unproven_hold(rig):
    """A stop without acknowledgement continues in the next run: zeros first, also while the e-stop prevents arming."""
    start_demo(rig)
    machine = rig.machine
    machine.bus.acknowledge_chip = False
    rig.open_estop()
    rig.run(5 * SECOND)
    machine.reset("pin", PINRSTF)
    reset_ns = machine.now_ns
    machine.bus.acknowledge_chip = True
    rig.run(300 * MS)
    rig.expect_resets("pin")
    assert rig.setpoints(reset_ns), "no zeros first"
    assert_zero(rig.setpoints(reset_ns))


def brown_out(rig):
    """In motion the board's supply fails for a moment, and that of the wheels does not: zeros first."""
    start_demo(rig)
    rig.machine.lose_power(ram_survives=True)
    failed_ns = rig.machine.now_ns
    rig.run(3 * SECOND)
    rig.expect_resets("power")
    zeros = rig.setpoints(failed_ns + MS)
    assert zeros and zeros[0].time_ns - failed_ns < 300 * MS, "no zeros first"
    assert_zero(zeros)


def stack_overflow(rig):
    """In motion the stack reaches its end: a fault, not a changed variable; the board restarts with zeros."""
    start_demo(rig)
    machine, overflow_ns = rig.machine, rig.machine.now_ns
    while machine.active or not machine.sleeping:
        rig.run(US)
    machine.cpu.reg_write(machine.SP, rig.stack_area[0])
    rig.run(2 * SECOND)
    rig.expect_resets("software")
    assert machine.faults == 1, "no fault"
    reset_ns = machine.resets[0][0]
    assert reset_ns - overflow_ns < 10 * MS, "the fault was not noticed immediately"
    assert_zeros_first(rig, reset_ns)
    assert_zero(rig.setpoints(overflow_ns + MS))
    reports = [line for line in rig.console() if "the previous run ended with fault 0x0C001000 at 0x00000000; the run before" in line]
    assert len(reports) == 1, rig.console()


def boot_loader(rig):
    """A boot loader starts the image, with its own vectors in force and interrupts masked: arms as after power-on, and the e-stop works."""
    rig.machine.start_by_boot_loader()
    rig.expect_resets("boot loader")
    arm(rig)
    pressed_ns = rig.open_estop()
    rig.run(1200 * MS)
    assert rig.setpoints(pressed_ns)[0].time_ns - pressed_ns <= EDGE_TO_ZERO_NS
    assert_lamp(rig, ESTOP)


def loop_stuck(rig):
    """In motion the main loop repeats one statement for ever while interrupts are still served: the watchdog resets the chip."""
    start_demo(rig)
    stuck_ns = rig.machine.now_ns
    rig.machine.divert()
    assert_watchdog_resets(rig, stuck_ns)
    rig.run(2 * SECOND)
    assert_zeros_first(rig, rig.machine.resets[0][0])
    assert_zero(rig.setpoints(stuck_ns + MS))


def stuck_while_listening(rig):
    """The same before anything was sent: the board restarts and sends nothing."""
    rig.machine.bus.wheels[1].power(False, 0)
    rig.run(500 * MS)
    rig.machine.divert()
    rig.run(SECOND)
    rig.expect_resets("watchdog")
    assert rig.machine.bus.attempts == 0, "it sent"
    rig.machine.bus.wheels[1].power(True, rig.machine.now_ns)
    arm(rig)


def demo_button_held_through_reset(rig):
    """The button that started the profile stays pressed while the watchdog resets the chip: no motion until it is released and pressed again."""
    arm(rig)
    rig.machine.board.drive("button", 0)
    rig.run(600 * MS)
    assert rig.setpoints()[-1].setpoint()[0] == 100, "the profile did not start"
    rig.machine.divert()
    rig.run(4 * SECOND)
    rig.expect_resets("watchdog")
    reset_ns = rig.machine.resets[0][0]
    assert_lamp(rig, ARMED)
    rig.machine.board.drive("button", None)
    rig.run(300 * MS)
    assert_zero(rig.setpoints(reset_ns))
    press_button(rig)
    rig.run(300 * MS)
    assert rig.setpoints()[-1].setpoint()[0] > 0, "no motion after a new press"


def demo_profile(rig):
    """Nothing moves before a press; the profile ends on its own where it began and is not repeated."""
    arm(rig, 1500 * MS)
    press_button(rig)
    rig.run(7500 * MS)
    frames = rig.setpoints(1500 * MS)
    speeds = [frame.setpoint()[0] for frame in frames]
    assert max(speeds) == 100 and min(speeds) == -100, f"speeds from {min(speeds)} to {max(speeds)} mm/s"
    assert_pairs(frames)
    assert_gaps(frames, 22 * MS)
    assert_zero(rig.setpoints(8200 * MS))
    assert abs(rig.machine.bus.wheels[0].ticks) < 1, "the wheels are not where they began"
    assert_lamp(rig, ARMED)


def demo_second_press_stops(rig):
    """A press in motion ends the profile with a ramp."""
    start_demo(rig)
    press_button(rig)
    rig.run(300 * MS)
    assert_zero(rig.setpoints(rig.machine.now_ns - 100 * MS))


def demo_button_held(rig):
    """The button is down when power comes: no motion before it is released and pressed again. While held, it repeats nothing."""
    rig.machine.board.drive("button", 0)
    arm(rig, 1500 * MS)
    rig.machine.board.drive("button", None)
    rig.run(500 * MS)
    assert_zero(rig.setpoints())
    press_button(rig, 7 * SECOND)
    rig.run(100 * MS)
    assert max(frame.setpoint()[0] for frame in rig.setpoints()) == 100
    assert_zero(rig.setpoints(rig.machine.now_ns - 500 * MS))


def demo_estop(rig):
    """E-stop in motion at several phases: a zero pair within 5 ms, and motion only after release, reset, arming and a press."""
    arm(rig)
    worst_ns = 0
    for phase_ns in (0, 3_100 * US, 6_700 * US, 11_900 * US, 19_000 * US):
        press_button(rig)
        rig.run(400 * MS + phase_ns)
        assert rig.setpoints()[-1].setpoint()[0] == 100, "no motion"
        pressed_ns = rig.open_estop()
        rig.run(300 * MS)
        press_button(rig)  # A reset while pressed is refused.
        rig.close_estop()
        rig.run(300 * MS)
        after = rig.setpoints(pressed_ns)
        zero = next(frame for frame in after if frame.setpoint() == ZERO)
        worst_ns = max(worst_ns, zero.time_ns - pressed_ns)
        assert_zero(after[after.index(zero) :])
        assert after.index(zero) <= 2, "more than one pair after the edge"
        press_button(rig)  # The reset.
        rig.run(SECOND)
        assert_zero(rig.setpoints(zero.time_ns))
    assert worst_ns <= EDGE_TO_ZERO_NS, f"first zero {worst_ns / MS:.3f} ms after the edge"
    rig.note(f"edge to zero on the bus at most {worst_ns / MS:.2f} ms")


# image -> scenarios; the watchdog's oscillator is nominal, slowest (0) or fastest (1) if stated.
SCENARIOS = {
    "listen": (listening, reset_while_listening),
    "zero": (
        nominal,
        console,
        time_never_goes_back,
        time_passes_32_bits_of_microseconds,
        time_passes_32_bits_of_milliseconds,
        fast_watchdog,
        estop,
        estop_pulse,
        estop_wakes,
        estop_chatters,
        estop_at_start,
        reset_by_button,
        wheel_missing,
        wheel_lost,
        no_acknowledgement,
        stuck_at_start,
        open_at_start,
        full_bus,
        overrun,
        second_master,
        no_crystal,
        slow_crystal,
        stuck_while_listening,
        boot_loader,
    ),
    "setpoint": (setpoint_role,),
    "demo": (
        demo_profile,
        demo_second_press_stops,
        demo_button_held,
        demo_button_held_through_reset,
        demo_estop,
        acknowledgement_lost,
        silence_is_silent,
        abort_without_end,
        cable_torn,
        receiver_open,
        bus_off,
        stuck_in_motion,
        babbling,
        crystal_dies,
        hang,
        loop_stuck,
        reset_again,
        reset_after_the_hold,
        reset_after_unproven_hold,
        brown_out,
        stack_overflow,
    ),
    "gateway": gateway_scenarios.SCENARIOS,
}
# The STM32F446 uses the files of the STM32F407; only the clock may differ.
BY_BOARD = {
    "stm32f103": {
        **SCENARIOS,
        "usb": (usb_pins,),
        "crystal12": (other_crystal,),
        "gateway_slow": (gateway_scenarios.another_rate,),
        "gateway_fast": (gateway_scenarios.another_rate,),
    },
    "stm32f407": {**SCENARIOS, "crystal": (other_crystal,)},
    "stm32g474": {**SCENARIOS, "crystal": (other_crystal,), "gateway": (*gateway_scenarios.SCENARIOS, *gateway_scenarios.OF_G474)},
    "stm32f446": {"zero": (nominal, console), "clock": (clock_input,), "demo": (crystal_dies,), "gateway": (gateway_scenarios.talks,)},
}
# Long, and independent of the chip's family: on the second board only in ./check --full.
LONG = (
    wheel_lost,
    estop_chatters,
    demo_profile,
    demo_second_press_stops,
    demo_button_held,
    second_master,
    babbling,
    overrun,
    cable_torn,
    stuck_while_listening,
    time_passes_32_bits_of_microseconds,
    time_passes_32_bits_of_milliseconds,
    reset_by_button,
    reset_again,
    reset_while_listening,
    silence_is_silent,
    abort_without_end,
    reset_after_the_hold,
    reset_after_unproven_hold,
    *gateway_scenarios.LONG,
)
# ... and of these the ones that depend on the bus controller, which is another one on the fourth board.
OF_THE_CONTROLLER = (babbling, overrun, cable_torn, silence_is_silent, abort_without_end)
LONG_ON = {"stm32f407": LONG, "stm32g474": tuple(scenario for scenario in LONG if scenario not in OF_THE_CONTROLLER)}
# image -> of its serial port, where it is not 115200.
BAUD = {"gateway": host.BAUD, "gateway_slow": 115_200, "gateway_fast": 2_000_000}
# Bytes of the stack reserved in sections.ld that every scenario leaves unused.
STACK_SPARE = 256
# image -> what differs around the chip.
WIRING = {"usb": {"transceiver": "PA11"}, "crystal": {"crystal_hz": 25_000_000}, "crystal12": {"crystal_hz": 12_000_000}}
OSCILLATOR = {fast_watchdog: 1, hang: 0, loop_stuck: 0, stuck_while_listening: 0, no_crystal: 1, clock_input: 1}
