# SPDX-License-Identifier: MIT
"""The DBC against the C codec, the golden vectors and the document's table."""

import os
import random
import re
import subprocess
import unittest

import golden_table
import pytest

cantools = pytest.importorskip("cantools", reason="cantools is missing in .venv")
pytestmark = pytest.mark.exact

DBC = golden_table.ROOT / "share/iwheel.dbc"
FRAMES_PER_MESSAGE = 2000
IDS = [256, 257, 266, 288, 289, 290, 298, 512, 513, 544, 545]
# Length, period in ms (of a setpoint: the gateway's default) and sender, from the document.
MESSAGES = {
    256: (4, 4, "LeftWheel"),
    257: (7, 40, "LeftWheel"),
    266: (5, 20, "Gateway"),
    288: (4, 4, "RightWheel"),
    289: (7, 40, "RightWheel"),
    290: (8, 40, "RightWheel"),
    298: (5, 20, "Gateway"),
    512: (4, 50, "LeftWheel"),
    513: (2, 1000, "LeftWheel"),
    544: (4, 50, "RightWheel"),
    545: (2, 1000, "RightWheel"),
}
UNIT_OF_SUFFIX = {
    "_rpm": "rpm",
    "_dV": "dV",
    "_degC": "degC",
    "_ticks": "ticks",
    "_percent": "%",
    "_mm_s": "mm/s",
    "_mA": "mA",
    "_mm": "mm",
    "_mrad": "mrad",
    "_cN": "cN",
    "_dN": "dN",
    "_raw": None,
    "_type": None,
}
# Names of fields whose unit the DBC defines: the C codec does not know the unit of a force.
DBC_NAME = {
    (266, "type"): "setpoint_type",
    (298, "type"): "setpoint_type",
    (512, "force_raw"): "normal_force_cN",
    (544, "force_raw"): "normal_force_dN",
    (513, "offset_dN"): "force_offset_dN",
    (545, "offset_dN"): "force_offset_dN",
}


def load(text):
    return cantools.database.load_string(text, database_format="dbc", strict=True)


def in_byte_order(message):
    """Its signals in the order of the frame's bytes: that of the codec's values."""
    return sorted(message.signals, key=lambda signal: signal.start // 8)


class Codec:
    """The C codec behind its pipe."""

    program = os.path.join(os.environ["IWHEEL_BUILD"], "test/dbc/iwheel_codec_line")

    def ask(self, lines):
        result = subprocess.run([self.program], input="\n".join(lines) + "\n", capture_output=True, text=True, check=True)
        answers = result.stdout.splitlines()
        if len(answers) != len(lines):
            raise RuntimeError(f"the codec answered {len(answers)} of {len(lines)} lines")
        return answers

    def decode(self, frames):
        """frames: (id, bytes); returns a list of values, or the text of the error, for each."""
        answers = self.ask([f"decode {can_id} {data.hex()}" for can_id, data in frames])
        return [answer if answer.startswith("error") else [int(word) for word in answer.split()[1:]] for answer in answers]

    def encode(self, commands):
        """commands: (id, values); returns (id, bytes) for each."""
        answers = self.ask([f"encode {can_id} {' '.join(map(str, values))}" for can_id, values in commands])
        return [(int(answer.split()[0]), bytes.fromhex(answer.split()[1])) for answer in answers]


def decoded_by_dbc(database, frames):
    result = []
    for can_id, data in frames:
        message = database.get_message_by_frame_id(can_id)
        values = message.decode(data, decode_choices=False, scaling=True)
        result.append([values[signal.name] for signal in in_byte_order(message)])
    return result


def encoded_by_dbc(database, commands):
    result = []
    for can_id, values in commands:
        message = database.get_message_by_frame_id(can_id)
        named = {signal.name: value for signal, value in zip(in_byte_order(message), values, strict=True)}
        result.append((can_id, message.encode(named, scaling=True, strict=False)))
    return result


def random_frames(seed, count):
    chance = random.Random(seed)
    return [(can_id, chance.randbytes(MESSAGES[can_id][0])) for can_id in IDS for _ in range(count)]


def random_commands(seed, count):
    """Any values that fit; a current within the document's range, beyond which the C codec clamps."""
    chance = random.Random(seed)
    commands = []
    for can_id, data in random_frames(seed + 1, count):
        values = decoded_by_dbc(DATABASE, [(can_id, data)])[0]
        if can_id in (266, 298):
            values[2] = chance.randint(-2000, 2000)
        commands.append((can_id, values))
    return commands


TEXT = DBC.read_text(encoding="utf-8")
DATABASE = load(TEXT)
CODEC = Codec()


class TestDatabase(unittest.TestCase):
    def test_has_the_eleven_messages_and_three_nodes(self):
        self.assertEqual(IDS, sorted(message.frame_id for message in DATABASE.messages))
        self.assertEqual(["Gateway", "LeftWheel", "RightWheel"], [node.name for node in DATABASE.nodes])

    def test_lengths_periods_and_senders_are_those_of_the_document(self):
        for message in DATABASE.messages:
            with self.subTest(message=message.name):
                self.assertEqual(MESSAGES[message.frame_id], (message.length, message.cycle_time, message.senders[0]))
                self.assertFalse(message.is_extended_frame)

    def test_messages_are_the_rows_of_the_core(self):
        rows = [answer.split() for answer in CODEC.ask([f"row {number}" for number in range(len(IDS))])]
        self.assertEqual(IDS, sorted(int(row[0]) for row in rows))
        for can_id, length, period_ms, kind, side in rows:
            message = DATABASE.get_message_by_frame_id(int(can_id))
            self.assertEqual(f"{side}{kind}", message.name.lower())
            self.assertEqual(int(length), message.length)
            # The core's row of a setpoint contains the longest permitted period; the DBC contains the gateway's default.
            self.assertTrue(message.cycle_time == int(period_ms) or (kind == "setpoint" and message.cycle_time < int(period_ms)))

    def test_every_message_has_its_number_in_hexadecimal(self):
        for message in DATABASE.messages:
            self.assertIn(f"0x{message.frame_id:03X}", message.comment)

    def test_signals_fill_their_frame_without_gap_or_overlap(self):
        for message in DATABASE.messages:
            self.assertEqual(8 * message.length, sum(signal.length for signal in message.signals), message.name)

    def test_signals_are_big_endian_and_name_their_unit(self):
        for message in DATABASE.messages:
            for signal in message.signals:
                with self.subTest(message=message.name, signal=signal.name):
                    self.assertEqual("big_endian", signal.byte_order)
                    suffix = max((s for s in UNIT_OF_SUFFIX if signal.name.endswith(s)), key=len)
                    self.assertEqual(UNIT_OF_SUFFIX[suffix], signal.unit or None)
                    self.assertEqual((1, 0), (signal.scale, signal.offset))
                    self.assertIsNotNone(signal.minimum)
                    self.assertIsNotNone(signal.maximum)

    def test_current_beyond_the_document_is_refused(self):
        message = DATABASE.get_message_by_name("LeftSetpoint")
        values = {"setpoint_type": 1, "speed_mm_s": 0, "current_mA": 2001}
        with self.assertRaises(cantools.database.EncodeError):
            message.encode(values)

    def test_force_units_match_the_document_and_are_marked_assumed(self):
        for name, unit in (("LeftForce", "cN"), ("RightForce", "dN")):
            signal = DATABASE.get_message_by_name(name).get_signal_by_name(f"normal_force_{unit}")
            self.assertEqual(unit, signal.unit)
            self.assertIn("ASSUMED", signal.comment)

    def test_full_battery_byte_has_a_name(self):
        for name in ("LeftStatus", "RightStatus"):
            signal = DATABASE.get_message_by_name(name).get_signal_by_name("battery_dV")
            self.assertEqual("at least 25.5 V", str(signal.choices[255]))


class TestAgainstTheCodec(unittest.TestCase):
    def test_random_frames_decode_alike(self):
        frames = random_frames(1, FRAMES_PER_MESSAGE)
        for frame, ours, theirs in zip(frames, CODEC.decode(frames), decoded_by_dbc(DATABASE, frames), strict=True):
            self.assertEqual(ours, theirs, frame)

    def test_random_values_encode_alike(self):
        commands = random_commands(2, FRAMES_PER_MESSAGE)
        for command, ours, theirs in zip(commands, CODEC.encode(commands), encoded_by_dbc(DATABASE, commands), strict=True):
            self.assertEqual(ours, theirs, command)

    def test_longer_frames_decode_alike(self):
        frames = [(can_id, data + b"\xa5" * (8 - len(data))) for can_id, data in random_frames(3, 50)]
        for frame, ours, theirs in zip(frames, CODEC.decode(frames), decoded_by_dbc(DATABASE, frames), strict=True):
            self.assertEqual(ours, theirs, frame)

    def test_shorter_frames_are_refused_by_both(self):
        frames = [(can_id, data[:length]) for can_id, data in random_frames(4, 1) for length in range(len(data))]
        for frame, ours in zip(frames, CODEC.decode(frames), strict=True):
            self.assertEqual("error", ours, frame)
            with self.assertRaises(cantools.database.DecodeError):
                decoded_by_dbc(DATABASE, [frame])

    def test_golden_vectors_decode_to_their_names_and_values(self):
        for vector in golden_table.read_vectors():
            with self.subTest(vector=vector.name):
                message = DATABASE.get_message_by_frame_id(vector.can_id)
                values = message.decode(vector.data, decode_choices=False)
                expected = {DBC_NAME.get((vector.can_id, key), key): value for key, value in vector.values}
                self.assertEqual(expected, values)
                self.assertEqual(vector.data, message.encode(expected, strict=False))


class TestThatFaultsAreSeen(unittest.TestCase):
    """A comparison that could not fail would prove nothing."""

    def differs(self, text):
        try:
            database = load(text)
            frames = random_frames(5, 40)
            return CODEC.decode(frames) != decoded_by_dbc(database, frames)
        except (cantools.Error, KeyError):
            return True

    def test_unchanged_text_differs_nowhere(self):
        self.assertFalse(self.differs(TEXT))

    def test_every_swapped_byte_order_sign_scale_and_place_is_seen(self):
        lines = [line for line in TEXT.splitlines() if line.startswith(" SG_")]
        self.assertEqual(28, len(lines))
        for number, line in enumerate(lines):
            place = re.search(r": (\d+)\|", line).group(1)
            faults = [
                line.replace("@0", "@1"),
                line.replace(f": {place}|", f": {int(place) - 1}|"),
                line.replace("@0+", "@0-") if "@0+" in line else line.replace("@0-", "@0+"),
                line.replace("(1,0)", "(10,0)"),
                line.replace("(1,0)", "(1,1)"),
            ]
            for fault in faults:
                with self.subTest(line=line, fault=fault):
                    self.assertNotEqual(line, fault)
                    self.assertTrue(self.differs(self.with_line(number, fault)))

    @staticmethod
    def with_line(number, replacement):
        lines = TEXT.splitlines()
        at = [index for index, line in enumerate(lines) if line.startswith(" SG_")][number]
        lines[at] = replacement
        return "\n".join(lines) + "\n"


class TestDocument(unittest.TestCase):
    def test_golden_table_of_the_document_is_that_of_the_header(self):
        self.assertTrue(golden_table.is_current(), "run test/dbc/golden_table.py --update")
