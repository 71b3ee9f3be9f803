# SPDX-License-Identifier: MIT
"""What the image must do, whatever happens around it. Each scenario is a function of a `Rig`; an AssertionError is a failure.

Verdicts are passed on the bus, the lamp and the count of resets: on what can be seen from outside.
"""
from emulator.can import LEFT, RIGHT, Frame
from emulator.chip import MS, US

SECOND = 1000 * MS
ZERO = (0, 2000) # Role "limit": zero speed with the configured maximum current.
EDGE_TO_ZERO_NS = 5 * MS
LISTENING, NO_BUS, NO_CRYSTAL = "1 flashes, 6.25 % lit", "2 flashes, 12.5 % lit", "3 flashes, 18.75 % lit"
ARMED, ESTOP, LATCHED = "steady", "1 flashes, 50 % lit", "2 flashes, 50 % lit"


def assert_zero(frames):
    for frame in frames:
        assert frame.setpoint() == ZERO, f"{frame.id} says {frame.setpoint()} at {frame.time_ns / MS:.3f} ms"


def assert_pairs(frames):
    """Left and right alternate, the right one within a millisecond."""
    for left, right in zip(frames[0::2], frames[1::2]):
        assert (left.id, right.id) == (LEFT, RIGHT), f"no pair at {left.time_ns / MS:.3f} ms"
        assert right.time_ns - left.time_ns < MS, f"the right setpoint is late at {right.time_ns / MS:.3f} ms"
    for frame in frames:
        assert len(frame.data) == 5 and frame.data[0] == 1, f"not the configured form: {frame}"


def assert_gaps(frames, longest_ns, side=LEFT):
    times = [frame.time_ns for frame in frames if frame.id == side]
    worst = max((b - a for a, b in zip(times, times[1:])), default=0)
    assert times and worst <= longest_ns, f"a gap of {worst / MS:.1f} ms between setpoints"


def assert_lamp(rig, pattern):
    seen = rig.machine.lamp.pattern(rig.machine.now_ns)
    assert seen == pattern, f"the lamp shows {seen}, not {pattern}"


def arm(rig, within_ns=SECOND):
    rig.run(within_ns)
    frames = rig.setpoints()
    assert len(frames) >= 4, "not armed"
    assert_zero(frames)
    assert_pairs(frames)


def assert_held_then_silent(rig, since_ns, hold_ns=1475 * MS):
    """Zeros for the hold, then nothing for as long as was run."""
    frames = rig.setpoints(since_ns)
    assert_zero(frames)
    assert frames and frames[-1].time_ns - since_ns >= hold_ns, "the zeros were not held"
    assert rig.machine.now_ns - frames[-1].time_ns > 300 * MS, "no silence after the hold"


def open_estop(rig):
    rig.machine.port_a.release(0) # Nothing but the pull-up drives the pin then, as with a cut wire.


def close_estop(rig):
    rig.machine.port_a.drive(0, 0)


def press_button(rig, span_ns=60 * MS):
    rig.machine.port_a.drive(1, 0)
    rig.run(span_ns)
    rig.machine.port_a.release(1)


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


def listening(rig):
    """Without setpoint type and role: hears everything, sends nothing, does not even acknowledge."""
    rig.run(2 * SECOND)
    assert not rig.setpoints() and rig.machine.bus.attempts == 0
    assert rig.machine.can.read(0x1C) >> 31 == 1, "the controller is not silent"
    assert rig.machine.can.timing() == (1_000_000, 625)
    assert rig.counter("received") > 1000, f"only {rig.counter('received')} frames received"
    assert_lamp(rig, LISTENING)


def fast_watchdog(rig):
    """The watchdog's oscillator at its fastest: still no reset, also while no frame wakes the loop."""
    for wheel in rig.machine.bus.wheels:
        wheel.power(False, 0)
    rig.run(500 * MS)
    for wheel in rig.machine.bus.wheels:
        wheel.power(True, rig.machine.now_ns)
    arm(rig)


def estop(rig):
    """Pressed while armed: a zero within 5 ms, held, then silence, also after the release."""
    arm(rig)
    rig.run(7_300 * US)
    pressed_ns = rig.machine.now_ns
    open_estop(rig)
    rig.run(2500 * MS)
    first = rig.setpoints(pressed_ns)[0]
    assert first.time_ns - pressed_ns <= EDGE_TO_ZERO_NS, f"first setpoint {(first.time_ns - pressed_ns) / MS:.3f} ms after the edge"
    assert_held_then_silent(rig, pressed_ns)
    assert_lamp(rig, ESTOP)
    close_estop(rig)
    rig.run(1500 * MS)
    assert_held_then_silent(rig, pressed_ns)
    assert_lamp(rig, LATCHED)


def estop_pulse(rig):
    """Open for 20 us: latched."""
    arm(rig)
    pressed_ns = rig.machine.now_ns
    open_estop(rig)
    rig.run(20 * US)
    close_estop(rig)
    rig.run(2500 * MS)
    assert_held_then_silent(rig, pressed_ns)
    assert_lamp(rig, LATCHED)


def estop_at_start(rig):
    """Pressed before power comes: nothing is sent, not after the release either."""
    open_estop(rig)
    rig.run(1200 * MS)
    assert_lamp(rig, ESTOP)
    close_estop(rig)
    rig.run(1200 * MS)
    assert_lamp(rig, LATCHED)
    assert not rig.setpoints() and rig.machine.bus.attempts == 0


def wheel_missing(rig):
    """One wheel only: nothing is sent. When the other one comes, it arms."""
    rig.machine.bus.wheels[1].power(False, 0)
    rig.run(1500 * MS)
    assert rig.machine.bus.attempts == 0, "armed with one wheel"
    assert_lamp(rig, LISTENING)
    rig.machine.bus.wheels[1].power(True, rig.machine.now_ns)
    arm(rig)


def wheel_lost(rig):
    """A wheel without power while armed: zeros for at most 10 s, then silence, and no arming when it comes back."""
    arm(rig)
    lost_ns = rig.machine.now_ns
    rig.machine.bus.wheels[0].power(False, lost_ns)
    rig.run(10_600 * MS)
    assert_held_then_silent(rig, lost_ns, 9900 * MS)
    rig.machine.bus.wheels[0].power(True, rig.machine.now_ns)
    rig.run(SECOND)
    assert_held_then_silent(rig, lost_ns, 9900 * MS)


def no_acknowledgement(rig):
    """Nobody acknowledges: not armed, not bus-off, no hang. With acknowledgements the pair that waited leaves, and it arms."""
    rig.machine.bus.acknowledge_chip = False
    rig.run(500 * MS)
    assert rig.machine.bus.attempts > 0 and not rig.setpoints()
    assert rig.machine.can.is_on(), "bus-off for want of acknowledgements"
    rig.machine.bus.acknowledge_chip = True
    back_ns = rig.machine.now_ns
    rig.run(SECOND)
    waited = rig.setpoints(back_ns, back_ns + 50 * MS)
    assert_zero(rig.setpoints())
    assert len(waited) <= 2, f"{len(waited)} stale setpoints"
    armed = rig.setpoints(back_ns + 50 * MS)
    assert len(armed) > 50, "not armed"
    assert_pairs(armed)


def acknowledgement_lost(rig):
    """In motion nobody acknowledges for 300 ms: latched, and what was waiting then never comes."""
    start_demo(rig)
    rig.machine.bus.acknowledge_chip = False
    lost_ns = rig.machine.now_ns
    rig.run(300 * MS)
    rig.machine.bus.acknowledge_chip = True
    rig.run(2500 * MS)
    assert_zero(rig.setpoints(lost_ns + MS))
    assert rig.counter("purges") >= 1
    assert_lamp(rig, LATCHED)


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
    """The bus is held dominant from the start: no hang, the lamp tells, and it arms when the bus is let go."""
    rig.machine.bus.hold_dominant(True)
    rig.run(2 * SECOND)
    assert_lamp(rig, NO_BUS)
    rig.machine.bus.hold_dominant(False)
    arm(rig, 1500 * MS)


def stuck_in_motion(rig):
    """The bus is held dominant for 300 ms while moving: latched, nothing stale afterwards."""
    start_demo(rig)
    stuck_ns = rig.machine.now_ns
    rig.machine.bus.hold_dominant(True)
    rig.run(300 * MS)
    rig.machine.bus.hold_dominant(False)
    rig.run(2500 * MS)
    assert_zero(rig.setpoints(stuck_ns))
    assert_lamp(rig, LATCHED)


def full_bus(rig):
    """Somebody fills the bus with short frames of an accepted id: none is lost, and setpoints go on leaving."""
    arm(rig)
    bus, start_ns, flooded = rig.machine.bus, rig.machine.now_ns, rig.machine.bus.flooded
    before = rig.counter("bad_format")
    bus.flood = Frame(545, b"", sender="flood", remote_dlc=3) # 47 bits with the space: none is shorter.
    rig.run(SECOND)
    bus.flood = None
    rig.run(50 * MS)
    frames = bus.flooded - flooded
    total = sum(1 for frame in bus.log if start_ns <= frame.time_ns < start_ns + SECOND)
    assert total >= 20_500, f"the bus was not full: {total} frames"
    assert rig.machine.can.overruns() == 0 and rig.counter("overruns") == 0, "the controller's FIFO overran"
    assert rig.counter("lost") == 0, f"{rig.counter('lost')} frames were lost"
    assert rig.counter("bad_format") - before == frames, f"{rig.counter('bad_format') - before} of {frames} frames were taken"
    assert_gaps(rig.setpoints(start_ns), 25 * MS)
    assert_zero(rig.setpoints(start_ns))
    rig.note(f"{total} frames/s")


def babbling(rig):
    """Somebody fills the bus with an id below ours: latched, since nothing leaves; zeros once it stops."""
    start_demo(rig)
    since_ns = rig.machine.now_ns
    rig.machine.bus.flood = Frame(1, bytes(8), sender="flood")
    rig.run(200 * MS)
    rig.machine.bus.flood = None
    rig.run(2 * SECOND)
    assert_zero(rig.setpoints(since_ns + MS))
    assert_lamp(rig, LATCHED)


def second_master(rig):
    """Somebody else's setpoint: latched."""
    arm(rig)
    rig.machine.bus.extra.append(Frame(RIGHT, bytes([1, 0, 0, 0, 0]), sender="master"))
    since_ns = rig.machine.now_ns
    rig.run(2500 * MS)
    assert_held_then_silent(rig, since_ns)
    assert_lamp(rig, LATCHED)


def no_crystal(rig):
    """No crystal: the bus is left alone, the lamp tells, no reset; when it comes, it arms."""
    rig.machine.clocks.set_crystal(False)
    rig.run(1200 * MS)
    assert_lamp(rig, NO_CRYSTAL)
    assert not rig.machine.can.is_on() and rig.machine.bus.attempts == 0
    rig.machine.clocks.set_crystal(True)
    arm(rig)


def crystal_dies(rig):
    """The crystal fails in motion: off the bus at once; when it comes back zeros first, and no motion by itself."""
    start_demo(rig)
    died_ns = rig.machine.now_ns
    rig.machine.clocks.set_crystal(False)
    rig.run(500 * MS)
    assert not [frame for frame in rig.setpoints(died_ns + 2 * MS)], "it went on sending"
    rig.machine.clocks.set_crystal(True)
    back_ns = rig.machine.now_ns
    rig.run(3 * SECOND)
    assert rig.setpoints(back_ns) and rig.setpoints(back_ns)[0].time_ns - back_ns < 300 * MS, "no zeros first"
    assert_zero(rig.setpoints(back_ns))
    rig.expect_resets("software")


def hang(rig):
    """The CPU hangs in motion: the watchdog, however slow its oscillator, begins anew with zeros."""
    start_demo(rig)
    hung_ns = rig.machine.now_ns
    rig.machine.frozen = True
    rig.run(300 * MS)
    rig.expect_resets("watchdog")
    assert rig.machine.resets, "the watchdog did not bite"
    assert rig.machine.resets[0][0] - hung_ns < 200 * MS, "the watchdog took too long"
    rig.run(3 * SECOND)
    reset_ns = rig.machine.resets[0][0]
    assert rig.setpoints(reset_ns)[0].time_ns - reset_ns < 300 * MS, "no zeros first"
    assert_zero(rig.setpoints(reset_ns))


def demo_profile(rig):
    """Nothing moves before a press; the profile ends by itself where it began and is not repeated."""
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
    """The button is down when power comes: no motion before it was let go and pressed again. Held, it repeats nothing."""
    rig.machine.port_a.drive(1, 0)
    arm(rig, 1500 * MS)
    rig.machine.port_a.release(1)
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
        pressed_ns = rig.machine.now_ns
        open_estop(rig)
        rig.run(300 * MS)
        press_button(rig) # A reset while pressed is refused.
        close_estop(rig)
        rig.run(300 * MS)
        after = rig.setpoints(pressed_ns)
        zero = next(frame for frame in after if frame.setpoint() == ZERO)
        worst_ns = max(worst_ns, zero.time_ns - pressed_ns)
        assert_zero(after[after.index(zero):])
        assert after.index(zero) <= 2, "more than one pair after the edge"
        press_button(rig) # The reset.
        rig.run(SECOND)
        assert_zero(rig.setpoints(zero.time_ns))
    assert worst_ns <= EDGE_TO_ZERO_NS, f"first zero {worst_ns / MS:.3f} ms after the edge"
    rig.note(f"edge to zero on the bus at most {worst_ns / MS:.2f} ms")


# image -> scenarios; the watchdog's oscillator is nominal, slowest (0) or fastest (1) where given.
SCENARIOS = {
    "listen": (listening,),
    "zero": (nominal, fast_watchdog, estop, estop_pulse, estop_at_start, wheel_missing, wheel_lost, no_acknowledgement,
             stuck_at_start, full_bus, second_master, no_crystal),
    "demo": (demo_profile, demo_second_press_stops, demo_button_held, demo_estop, acknowledgement_lost, bus_off, stuck_in_motion,
             babbling, crystal_dies, hang),
}
OSCILLATOR = {fast_watchdog: 1, hang: 0, no_crystal: 1}
