# SPDX-License-Identifier: MIT
"""Recordings and findings: iwheelctl learn concludes nothing without complete data.

A generator writes recordings that have or lack, one at a time, the data for a finding. The tests state the expected finding for
each recording; it follows from the recorded data, not from the code of learn.
"""

import itertools
import json
import struct
import unittest
from dataclasses import dataclass, replace

import pytest
from ctl import run

pytestmark = pytest.mark.exact
SIDES = ("left", "right")
IDS = {"setpoint": ("10A", "12A"), "speed": ("100", "120"), "status": ("101", "121"), "force": ("200", "220"), "offset": ("201", "221")}
PHASES = {"rest": 0, "forward": 400, "backward": -400}
CURRENTS = {"same": lambda speed: 1500, "scaled": lambda speed: 3 * speed, "negative": lambda speed: -1500, "zero": lambda speed: 0}


@dataclass(frozen=True)
class Story:
    """A drive. A pair of values is (left, right)."""

    phases: tuple[str, ...] = ("rest", "forward", "backward")
    phase_ms: int = 4000
    currents: tuple[str, str] = ("same", "same")
    commanded: tuple[bool, bool] = (True, True)
    types: tuple[int, int] = (3, 3)
    rest_type: int | None = None  # Another type with speed 0.
    second_type: int | None = None  # Every other setpoint has it.
    spare: tuple[int, ...] = (0,)  # Bytes behind the fifth, in turn.
    sent: str = "none"  # "all", "some": marked as the recorder's own.
    setpoint_ms: int = 20
    turns: tuple[bool, bool] = (True, True)
    runs_at_zero: tuple[bool, bool] = (False, False)
    stutters: bool = False  # At speed for every other fifth of a second.
    signs: tuple[int, int] = (1, 1)
    flips: bool = False  # Backwards it measures the sign of forwards.
    rpm_per_speed: float = 1 / 20.106
    ticks_per_turn: float = 60.0
    ticks_gap: bool = False  # Speed frames are lost for 150 ms in every second.
    speeds: tuple[bool, bool] = (True, True)
    statuses: tuple[bool, bool] = (True, True)
    raw: tuple[int | None, int | None] = (200, 20)
    sway: int = 0
    offsets: tuple[tuple[int, ...], tuple[int, ...]] = ((20,), (20,))
    pose_step: int = 10  # mm per frame; 0: at standstill. None is not possible: see poses.
    poses: int = 10000
    pose_little: bool = False

    def rpm(self, side, at_ms, phase):
        speed = PHASES[phase]
        if speed == 0:
            return 15 if self.runs_at_zero[side] else 0
        if not self.turns[side] or not self.commanded[side] or (self.stutters and at_ms // 200 % 2):
            return 0
        sign = self.signs[side] * (-1 if self.flips and phase == "backward" else 1)
        return round(speed * self.rpm_per_speed) * sign

    def frames(self):
        """(ms, id, data, marked) in time's order."""
        ticks, poses, count = [0.0, 0.0], 0, [0, 0]
        for number, phase in enumerate(self.phases):
            for at_ms in range(number * self.phase_ms, (number + 1) * self.phase_ms, 4):
                for side in (0, 1):
                    rpm = self.rpm(side, at_ms - number * self.phase_ms, phase)
                    ticks[side] += abs(rpm) / 60000 * 4 * self.ticks_per_turn
                    if self.commanded[side] and at_ms % self.setpoint_ms == 0:
                        yield (
                            at_ms,
                            IDS["setpoint"][side],
                            self.setpoint(side, phase, count[side]),
                            self.sent == "all" or (self.sent == "some" and count[side] % 2),
                        )
                        count[side] += 1
                    if self.speeds[side] and not (self.ticks_gap and at_ms % 1000 < 150):
                        yield at_ms, IDS["speed"][side], struct.pack(">hh", rpm, 0), False
                    if self.statuses[side] and at_ms % 40 == 0:
                        yield at_ms, IDS["status"][side], b"\xf8\x1c" + struct.pack(">i", int(ticks[side])) + b"\x1e", False
                    if self.raw[side] is not None and at_ms % 48 == 0:
                        sway = self.sway if at_ms % 96 else -self.sway
                        yield at_ms, IDS["force"][side], struct.pack(">hh", self.raw[side] + sway, 0), False
                    if self.offsets[side] and at_ms % 1000 == 0:
                        value = self.offsets[side][at_ms // 1000 % len(self.offsets[side])]
                        yield at_ms, IDS["offset"][side], struct.pack(">h", value), False
                if at_ms % 40 == 0 and poses < self.poses:
                    poses += 1
                    yield at_ms, "122", struct.pack("<4h" if self.pose_little else ">4h", poses * self.pose_step, 0, 0, 0), False

    def setpoint(self, side, phase, count):
        kind = self.types[side]
        if self.rest_type is not None and phase == "rest":
            kind = self.rest_type
        if self.second_type is not None and count % 2:
            kind = self.second_type
        speed = PHASES[phase]
        return struct.pack(">Bhh", kind, speed, CURRENTS[self.currents[side]](speed)) + bytes(self.spare[count % len(self.spare)])

    def text(self):
        return "".join(f"({at / 1000:.6f}) can0 {number}#{data.hex().upper()}{' T' if mark else ''}\n" for at, number, data, mark in self.frames())


def learn(story, *words):
    return run(*words, "learn", "-", input=story.text())


def findings(story):
    """Findings by (item, side): (verdict, value). The first of several counts."""
    _, out, err = learn(story, "--json")
    if not out:
        raise AssertionError(err)
    found = {}
    for each in json.loads(out)["findings"]:
        found.setdefault((each["item"], each["side"]), (each["verdict"], each["value"]))
    return found


FOR, AGAINST, OPEN = "for", "against", ("unknown", None)


class Matrix(unittest.TestCase):
    """Every subset of {rest, forward, backward}, with every current, commanded to both wheels or one."""

    def expected_role(self, story):
        covered = all(phase in story.phases for phase in PHASES) and all(story.commanded)
        if not covered:
            return OPEN
        return {("same", "same"): (FOR, "limit"), ("scaled", "scaled"): (FOR, "setpoint")}.get(story.currents, OPEN)

    def expected_type(self, story):
        moves = "forward" in story.phases or "backward" in story.phases
        return (FOR, "3") if moves and all(story.commanded) else OPEN

    def expected_sign(self, story, side):
        moves = "forward" in story.phases or "backward" in story.phases
        return (FOR, "yes") if moves and story.commanded[side] else OPEN

    def test_learn_any_subset_of_inputs_concludes_only_from_them(self):
        subsets = [kinds for size in range(4) for kinds in itertools.combinations(PHASES, size)]
        count = 0
        for phases, current, commanded in itertools.product(subsets, itertools.product(CURRENTS, repeat=2), ((True, True), (True, False), (False, True))):
            if not phases or (current[0] != current[1] and len(phases) < 3):
                continue
            story = Story(phases=phases, currents=current, commanded=commanded)
            with self.subTest(phases=phases, current=current, commanded=commanded):
                found = findings(story)
                self.assertEqual(self.expected_role(story), found.get(("current_role", None), OPEN))
                self.assertEqual(self.expected_type(story), found[("setpoint_type", None)])
                for side in (0, 1):
                    self.assertEqual(self.expected_sign(story, side), found[("feedback_sign", SIDES[side])])
            count += 1
        self.assertGreaterEqual(count, 7 * 4 * 3)

    def test_learn_recording_of_nothing_concludes_nothing(self):
        for story in (Story(commanded=(False, False)), Story(commanded=(False, False), phases=("rest",))):
            for key, (verdict, _) in findings(story).items():
                if key[0] in ("setpoint_type", "current_role", "setpoint_dlc", "feedback_sign", "speed_scale"):
                    self.assertEqual("unknown", verdict, key)

    def test_learn_one_speed_and_one_current_is_no_role(self):
        """The recording with which it was found."""
        code, out, _ = learn(Story(phases=("forward",)))
        self.assertEqual(0, code)
        self.assertIn("? current role: not commanded to both wheels often enough: speed 0, backwards; ", out)
        self.assertNotIn("current_role =", out)


class Lacks(unittest.TestCase):
    """A recording with all data; then, one at a time, the data for a finding are removed."""

    WHOLE = Story()
    FOUND = {
        ("setpoint_type", None): (FOR, "3"),
        ("current_role", None): (FOR, "limit"),
        ("setpoint_dlc", None): (FOR, "5"),
        ("feedback_sign", "left"): (FOR, "yes"),
        ("feedback_sign", "right"): (FOR, "yes"),
        ("speed_scale", "left"): (FOR, None),
        ("speed_scale", "right"): (FOR, None),
        ("ticks_per_turn", "left"): (FOR, None),
        ("ticks_per_turn", "right"): (FOR, None),
        ("force_unit", "left"): (FOR, "cN"),
        ("force_unit", "right"): (FOR, "dN"),
        ("pose_byte_order", None): (FOR, "yes"),
        ("mounting", None): OPEN,
        ("pair", None): (FOR, None),
    }

    def differs(self, changes, **story):
        """The findings are those of the whole recording, except the changes: keys as "item" or "item side"."""
        expected = dict(self.FOUND)
        for key, verdict in changes.items():
            item, _, side = key.partition(" ")
            expected[(item, side or None)] = verdict
        found = findings(replace(self.WHOLE, **story))
        self.assertEqual(expected, {key: verdict for key, verdict in found.items() if key in expected})
        return found

    def of(self, side, *items, verdict=OPEN):
        return {f"{item} {side}": verdict for item in items}

    def both(self, *items, verdict=OPEN):
        return self.of("left", *items, verdict=verdict) | self.of("right", *items, verdict=verdict)

    def test_learn_whole_recording_has_all_findings(self):
        found = self.differs({})
        self.assertEqual(set(self.FOUND) | {("wheel_lag", side) for side in SIDES}, set(found), "nothing else")
        self.assertEqual([(AGAINST, None)] * 2, [found[("wheel_lag", side)] for side in SIDES], "these wheels follow immediately")

    def test_learn_telemetry_of_no_wheel_leaves_wheel_items_open(self):
        self.differs(
            {"setpoint_type": OPEN, "current_role": OPEN, "pair": OPEN, **self.both("feedback_sign", "speed_scale", "ticks_per_turn", "force_unit")},
            speeds=(False, False),
        )

    def test_learn_telemetry_of_one_wheel_leaves_what_both_do_open(self):
        self.differs(
            {"setpoint_type": OPEN, "current_role": OPEN, "pair": OPEN, **self.of("right", "feedback_sign", "speed_scale", "ticks_per_turn", "force_unit")},
            speeds=(True, False),
        )

    def test_learn_wheel_that_does_not_turn_contradicts_the_type(self):
        self.differs(
            {
                "setpoint_type": (AGAINST, None),
                "current_role": OPEN,
                "pair": (AGAINST, None),
                **self.of("left", "feedback_sign", "speed_scale", "ticks_per_turn"),
            },
            turns=(False, True),
        )

    def test_learn_wheel_that_stutters_shows_no_type_and_no_scale(self):
        self.differs({"setpoint_type": OPEN, "current_role": OPEN, **self.both("speed_scale", "ticks_per_turn")}, stutters=True)

    def test_learn_wheel_that_runs_at_zero_contradicts_a_limit(self):
        for which in ((True, False), (False, True)):
            self.differs({"current_role": (AGAINST, None), **({"force_unit left": OPEN} if which[0] else {"force_unit right": OPEN})}, runs_at_zero=which)

    def test_learn_too_short_phases_have_no_wheel_findings(self):
        self.differs(
            {"setpoint_type": OPEN, "current_role": OPEN, "pose_byte_order": OPEN, **self.both("feedback_sign", "speed_scale", "ticks_per_turn", "force_unit")},
            phase_ms=300,
        )

    def test_learn_too_few_setpoints_have_no_findings(self):
        found = findings(Story(setpoint_ms=4000))
        for item in ("setpoint_type", "current_role", "setpoint_dlc"):
            self.assertEqual(OPEN, found[(item, None)], item)

    def test_learn_setpoints_that_stop_prove_no_steady_wheel(self):
        found = findings(Story(setpoint_ms=1200))
        for key in (("setpoint_type", None), ("feedback_sign", "left"), ("speed_scale", "right")):
            self.assertEqual(OPEN, found[key], key)

    def test_learn_types_that_change_or_differ_contradict_one_type(self):
        unsure = {"setpoint_type": (AGAINST, None)}
        self.differs(unsure, types=(3, 4))
        found = self.differs(unsure, second_type=9)
        self.assertEqual((AGAINST, None), found[("sender", "left")])

    def test_learn_other_type_at_standstill_is_reported(self):
        found = self.differs({}, rest_type=0)
        self.assertEqual(OPEN, found[("setpoint_type", "left")])
        self.assertEqual(OPEN, found[("setpoint_type", "right")])

    def test_learn_lengths_that_are_mixed_are_no_length(self):
        self.differs({"setpoint_dlc": OPEN}, spare=(0, 3))
        self.differs({"setpoint_dlc": (AGAINST, "8")}, spare=(3,))

    def test_learn_own_setpoints_are_no_role(self):
        for sent in ("all", "some"):
            found = self.differs({"current_role": OPEN}, sent=sent)
            self.assertEqual((AGAINST, None), found[("sender", None)])

    def test_learn_currents_different_per_wheel_suggest_no_role(self):
        for currents in (("same", "scaled"), ("scaled", "same"), ("same", "zero"), ("negative", "scaled")):
            self.differs({"current_role": OPEN}, currents=currents)

    def test_learn_sign_is_reported_only_for_the_seen_direction(self):
        for phase, word in (("forward", "positive"), ("backward", "negative")):
            _, out, _ = learn(Story(phases=("rest", phase)))
            self.assertIn(f"+ left: a {word} setpoint is measured as a {word} speed (the other direction: not recorded)", out)

    def test_learn_signs_that_are_swapped_or_mixed_contradict(self):
        self.differs({"feedback_sign right": (AGAINST, "no"), "pair": (AGAINST, None)}, signs=(1, -1))
        self.differs(self.both("feedback_sign", verdict=(AGAINST, None)), flips=True)

    def test_learn_gear_is_reported_by_ratio_and_ticks(self):
        self.differs(self.both("speed_scale", verdict=(AGAINST, None)), rpm_per_speed=3 / 20.106)
        self.differs(self.both("ticks_per_turn", verdict=(AGAINST, None)), ticks_per_turn=240)

    def test_learn_ticks_need_speed_frames_all_the_time(self):
        self.differs({}, ticks_gap=True)
        self.differs(self.both("ticks_per_turn"), statuses=(False, False))

    def test_learn_force_unit_needs_rest_quiet_and_one_offset(self):
        unsure = self.both("force_unit")
        self.differs({"force_unit left": OPEN}, raw=(None, 20))
        self.differs({"force_unit right": OPEN}, offsets=((20,), ()))
        self.differs({"force_unit right": OPEN}, offsets=((20,), (19,)))
        self.differs({"force_unit left": OPEN}, offsets=((20, 40), (20,)))
        self.differs(unsure, sway=60)

    def test_learn_force_without_rest_is_no_unit(self):
        found = findings(Story(phases=("forward", "backward")))
        self.assertEqual(OPEN, found[("force_unit", "left")])

    def test_learn_force_that_is_neither_unit_concludes_none(self):
        self.differs({"force_unit left": (AGAINST, None), "force_unit right": (AGAINST, None)}, raw=(0, 80))
        self.differs({"force_unit left": (AGAINST, "dN"), "force_unit right": (AGAINST, "cN")}, raw=(20, 200))

    def test_learn_pose_absent_constant_or_jumping_has_no_order(self):
        for lack in ({"poses": 0}, {"pose_step": 0}, {"poses": 3, "pose_step": 5000}):
            self.differs({"pose_byte_order": OPEN}, **lack)
        self.differs({"pose_byte_order": (AGAINST, "no")}, pose_little=True)


class AsJson(unittest.TestCase):
    """The JSON object has the findings of the text."""

    def test_learn_json_has_each_sentence_and_suggestion_of_text(self):
        for story in (Story(), Story(phases=("forward",)), Story(types=(3, 4), spare=(3,)), Story(raw=(20, 200), sent="all"), Story(commanded=(False, False))):
            code, out, _ = learn(story, "--json")
            code_of_text, text, _ = learn(story)
            self.assertEqual(code_of_text, code)
            self.assertEqual(1, out.count("\n"))
            result = json.loads(out)
            marks = {"for": "+", "against": "-", "unknown": "?"}
            sentences = [f"  {marks[each['verdict']]} {each['text']}" for each in result["findings"]]
            self.assertEqual([line for line in text.splitlines() if line[:4] in ("  + ", "  - ", "  ? ")], sentences)
            lines = [line for section, keys in result["suggested"].items() for line in (f"[{section}]", *(f"{key} = {value}" for key, value in keys.items()))]
            self.assertEqual(lines, text.split("then: iwheelctl bringup)\n\n")[-1].splitlines() if lines else [])

    def test_learn_json_counts_the_observations(self):
        result = json.loads(learn(Story(), "--json")[1])
        left = result["setpoints"]["left"]
        self.assertEqual(
            (266, 600, {"3": 600}, [1500, 1500], [-400, 400], [5, 5], 20),
            (left["id"], left["frames"], left["types"], left["current_mA"], left["speed_mm_s"], left["length"], left["period_ms"]),
        )
        self.assertEqual((200, 200, 200), (left["at_rest"], left["forward"], left["backward"]))
        wheel = result["wheels"]["left"]
        self.assertAlmostEqual(3000, wheel["told_forward"]["with_ms"], delta=50)
        self.assertEqual((0, 0), (wheel["told_forward"]["against_ms"], wheel["told_forward"]["still_ms"]))
        self.assertAlmostEqual(3000, wheel["stood_at_zero_ms"], delta=50)
        self.assertEqual([20, 20], wheel["offset_dN"])
        self.assertEqual(([{"begin_us": 4000000, "end_us": 11980000, "deviation_mm": 0}], 0), (result["drives"], result["more_drives"]))
        self.assertEqual([256, 288, 257, 289, 290, 512, 544, 513, 545], [each["id"] for each in result["telemetry"]])
        self.assertEqual(None, json.loads(learn(Story(commanded=(False, True)), "--json")[1])["setpoints"]["left"]["current_mA"])

    def test_learn_json_without_telemetry_is_object_and_status_1(self):
        code, out, _ = run("--json", "learn", "-", input="(1.000000) can0 100#00000000\n")
        self.assertEqual((1, 1), (code, json.loads(out)["frames"]))
