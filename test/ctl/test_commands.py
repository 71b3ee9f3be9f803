# SPDX-License-Identifier: MIT
"""One grammar for all verbs of iwheelctl: durations, --json, help, what is nearly right, completion, 80 columns."""

import json
import os
import re
import shutil
import subprocess
import tempfile
import time
import unittest
from pathlib import Path

import pytest

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
from ctl import environment, program, run
from operator_at_terminal import Operator

pytestmark = pytest.mark.native("processor time: these start hundreds of programs and hardly wait")
# Those that talk with a person.
WITHOUT_JSON = {"top", "bringup", "help", "web", "export"}


def verbs():
    return [line.split("\t")[0] for line in run("help", "--list")[1].splitlines()]


def listed(verb):
    return run("help", verb, "--list")[1].split()


class Grammar(unittest.TestCase):
    # Every option of every verb that has a time as its value: the words before it, the range.
    DURATIONS = ((("drive", "1", "2", "--for"), "20ms to 10min"), (("record", "-", "--for"), "1ms to 720h"), (("doctor", "--listen"), "200ms to 1min"))

    def test_every_duration_is_written_alike_and_refused_alike(self):
        for words, bounds in self.DURATIONS:
            for wrong, fix in (("2", "2s"), ("0.5", "0.5s"), ("1m", "1min"), ("soon", ""), ("-1s", ""), ("1.s", ""), ("1.2345s", ""), ("999999999", "")):
                code, out, err = run("--socket", "/nonexistent", *words, wrong)
                hint = f"; write: {words[-1]} {fix}" if fix else ""
                self.assertEqual(
                    (64, "", f'iwheelctl: {words[-1]} needs a time with its unit, such as 500ms, 1.5s, 2min or 1h, not "{wrong}"{hint}\n'),
                    (code, out, err),
                    words,
                )
            code, _, err = run("--socket", "/nonexistent", *words, "")
            self.assertEqual((64, True), (code, "is empty; leave it out" in err), err)
            code, _, err = run("--socket", "/nonexistent", *words, "0s")
            self.assertEqual((64, f"iwheelctl: {words[-1]} 0s is out of range; write {bounds}\n"), (code, err))
            for right in ("300ms", "0.3s", "0.005min") + (("2s", "0.001h") if words[0] == "drive" else ()):
                more = ("unix:/nonexistent",) if words[0] == "doctor" else ("--can", "unix:/nonexistent") if words[0] == "record" else ()
                self.assertNotEqual(64, run("--socket", "/nonexistent", *words, right, *more)[0], (words, right))

    def test_no_other_option_of_a_verb_has_a_time(self):
        """A new one belongs into the table above."""
        with_time = {(verb, option) for verb in verbs() for option in re.findall(r"^(--[a-z-]+) TIME", run("help", verb)[1], re.MULTILINE)}
        self.assertEqual({(words[0], words[-1]) for words, _ in self.DURATIONS}, with_time)

    def test_verb_misspelt_gets_a_suggestion_and_unknown_the_list(self):
        for typed, meant in (("staus", "status"), ("recrod", "record"), ("dirve", "drive"), ("doc", "doctor"), ("hepl", "help")):
            code, _, err = run(typed)
            self.assertEqual((64, f'iwheelctl: unknown verb "{typed}"; did you mean {meant}? All: iwheelctl help\n'), (code, err))
            code, _, same = run("help", typed)
            self.assertEqual((64, err), (code, same))
        self.assertIn("known verbs: status top", run("xyzzy")[2])


class Web(unittest.TestCase):
    def of_another_program(self, verb, package, program, calls):
        """The verb says what to install; and when it is there calls the program with these words."""
        with tempfile.TemporaryDirectory() as folder:
            code, out, err = run(verb, env=environment(PATH=folder))
            self.assertEqual((69, ""), (code, out))
            self.assertIn(f"apt-get install ./{package}_*.deb", err)
            fake = Path(folder, program)
            fake.write_text('#!/bin/sh\necho "called $*"\n', encoding="ascii")
            fake.chmod(0o755)
            for words, passed in calls.items():
                self.assertEqual((0, f"called {passed}\n", ""), run(verb, *words, env=environment(PATH=folder)))

    def test_web_is_the_bridges_own_word_or_says_what_to_install(self):
        self.of_another_program("web", "iwheel-web", "iwheel-web", {(): "--url"})
        self.assertEqual(64, run("web", "word")[0])

    def test_fleet_is_the_consoles_own_word_or_says_what_to_install(self):
        words = ("history", "w1", "--json", "--last", "12h")
        self.of_another_program("fleet", "iwheel-mqtt", "iwheel-fleet", {(): "", words: "history w1 --last 12h --json"})


class Json(unittest.TestCase):
    def test_verbs_without_answer_refuse_json_with_a_sentence(self):
        for verb in WITHOUT_JSON:
            for words in (("--json", verb), (verb, "--json")):
                code, out, err = run(*words)
                self.assertEqual((64, ""), (code, out), words)
                self.assertRegex(err, r"^iwheelctl: .*json|JSON", verb)
            self.assertNotIn("--json", listed(verb))
            self.assertNotIn("[--json]", run("help", verb)[1])

    def test_every_other_verb_offers_it(self):
        for verb in set(verbs()) - WITHOUT_JSON:
            self.assertIn("--json", listed(verb))
            self.assertIn("[--json]", run("help", verb)[1])

    def test_replay_as_json_has_the_same_decisions(self):
        recording = os.path.join(ROOT, "test", "recordings", "estop.log")
        code, text, _ = run("replay", recording)
        self.assertEqual(0, code)
        code, out, err = run("--json", "replay", recording)
        self.assertEqual((0, ""), (code, err))
        objects = [json.loads(line) for line in out.splitlines()]
        lines_printed = [line for line in text.splitlines() if not line.startswith("#")]
        timed = [entry for entry in objects if "t_us" in entry]
        self.assertGreater(len(timed), 5)
        for line, entry in zip(lines_printed, timed, strict=True):
            self.assertTrue(line.endswith(entry["text"]), (line, entry))
            self.assertEqual(line.split()[0], f"{entry['t_us'] // 1000000}.{entry['t_us'] % 1000000:06}")
        self.assertEqual({"summary"}, {entry["event"] for entry in objects if "t_us" not in entry} - {"note"})
        summary = objects[-1]
        self.assertEqual("summary", summary["event"])
        for name, what in (("setpoints", "setpoints on the bus"), ("states", "changes of state"), ("stops", "stops")):
            score = summary["as_recorded"][name]
            self.assertIn(f"# {what}: {score['same']} of {score['same'] + score['different']} as recorded", text)

    def test_record_to_standard_output_cannot_be_json_as_well(self):
        code, out, err = run("--json", "record", "-")
        self.assertEqual((64, ""), (code, out))
        self.assertIn("name a FILE", err)

    def test_unexpected_word_is_refused_by_the_verb_that_was_typed(self):
        for verb in ("status", "stop", "disarm", "reset", "release", "ledger"):
            code, out, err = run("--socket", "/nonexistent", verb, "extra")
            expected = f'iwheelctl: {verb} does not understand "extra"; see: iwheelctl {verb} --help'
            self.assertEqual((69 if verb in ("stop", "disarm") else 64, "", expected), (code, out, err.splitlines()[-1]))


class Help(unittest.TestCase):
    def test_help_of_a_verb_is_the_page_of_its_option(self):
        for verb in verbs():
            self.assertEqual(run(verb, "--help"), run("help", verb))
        self.assertEqual(run("--help"), run("help"))

    def test_no_help_is_wider_than_80_columns(self):
        pages = [("iwheelctl", ("help",)), ("iwheel-gateway", ("--help",)), ("iwheel-sim", ("--help",)), *(("iwheelctl", ("help", verb)) for verb in verbs())]
        for name, words in pages:
            code, out, _ = run(*words, name=name)
            self.assertEqual(0, code, (name, words))
            self.assertGreater(out.count("\n"), 2)
            for line in out.splitlines():
                self.assertLessEqual(len(line), 80, (name, words, line))

    def test_options_of_each_page_are_in_its_usage_and_accepted(self):
        for verb in verbs():
            page = run("help", verb)[1]
            explained = set(re.findall(r"^(--[a-z-]+)", page, re.MULTILINE))
            usage = page.split("\n\n")[0]
            self.assertEqual(explained, set(re.findall(r"--[a-z-]+", usage)) - {"--json", "--socket"}, verb)
            for option in explained:
                err = run("--socket", "/nonexistent", verb, option)[2]
                self.assertNotRegex(err, f'does not understand "{option}"|no topic|unknown option', (verb, option))


ITEMS = ["setpoint_type", "current_role", "force_unit_left", "wheel_radius", "track", "dlc"]


class Completion(unittest.TestCase):
    """Each shell offers exactly the words that the program lists; the test requests them as the shell does."""

    def environment(self):
        folders = [os.path.dirname(os.path.abspath(program(name))) for name in ("iwheelctl", "iwheel-gateway", "iwheel-sim")]
        return {**os.environ, "PATH": ":".join([*folders, os.environ["PATH"]])}

    def ask(self, *command):
        done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False, env=self.environment(), cwd=ROOT, stdin=subprocess.DEVNULL)
        return set(done.stdout.split("\n")) - {""}

    def bash(self, *words, program="_iwheelctl"):
        return self.ask(
            "bash",
            "-c",
            'source share/completions/iwheel.bash; f=$1; shift; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); "$f" "$1"; printf "%s\\n" "${COMPREPLY[@]}"',
            "bash",
            program,
            *words,
        )

    def fish(self, *words):
        lines = self.ask("fish", "--no-config", "-c", 'source share/completions/iwheelctl.fish; complete -C "$argv"', " ".join(words))
        return {line.split("\t")[0] for line in lines}

    def zsh(self, *words):
        """Types the words and two tabs on a terminal; returns the text on it."""
        operator = Operator(["zsh", "-f", "-i"], {**self.environment(), "TERM": "dumb", "PS1": "", "PROMPT": ""}, 200, 50)
        self.addCleanup(operator.close)
        with tempfile.TemporaryDirectory() as folder:
            operator.type(
                f"fpath=({ROOT}/share/completions $fpath); autoload -U compinit; compinit -u -d {folder}/dump; "
                "setopt list_ambiguous auto_list no_auto_menu; LISTMAX=0; unset zle_bracketed_paste; print REA''DY\n"
            )
            operator.expect("READY")
            operator.type(" ".join(words) + "\t\t")
            operator.expect(words[-1] if words[-1] else words[0])
            return self.offered(operator, set(words))

    def offered(self, operator, typed):
        """Output until a second without output, or nothing for 6 s: on a busy machine a list may need long."""
        offer, end, quiet = set(), time.monotonic() + 6, time.monotonic()
        while time.monotonic() < (quiet + 1 if offer else end):
            before = len(operator.text)
            operator.pump(0.05)
            quiet = time.monotonic() if len(operator.text) > before else quiet
            offer = set(re.findall(r"[\w-]+", operator.text[operator.seen :])) - typed
        return offer

    def shells(self):
        yield self.bash
        for name, shell in (("fish", self.fish), ("zsh", self.zsh)):
            if shutil.which(name):
                yield shell

    def test_all_shells_are_there(self):
        missing = [name for name in ("fish", "zsh") if not shutil.which(name)]
        if missing:
            self.skipTest(f"{' '.join(missing)} missing (scripts/install_tools check brings them)")

    def test_every_shell_offers_every_verb(self):
        for shell in self.shells():
            self.assertLessEqual(set(verbs()), shell("iwheelctl", ""), shell.__name__)

    def test_shell_completion_after_confirm_offers_assumptions(self):
        for shell in self.shells():
            self.assertLessEqual(set(ITEMS), shell("iwheelctl", "confirm", ""), shell.__name__)
            self.assertIn("--how", shell("iwheelctl", "confirm", "track", "545", "--"), shell.__name__)
            self.assertFalse({"wheel_radius", "--socket"} & shell("iwheelctl", "confirm", "track", "--how", ""), shell.__name__)

    def test_shell_completion_offers_only_arguments_of_the_verb(self):
        for shell in self.shells():
            self.assertLessEqual({"state", "bus", "frame"}, shell("iwheelctl", "watch", ""), shell.__name__)
            self.assertLessEqual({"left", "right"}, shell("iwheelctl", "tare", ""))
            offered = shell("iwheelctl", "drive", "--")
            self.assertLessEqual({"--for", "--takeover", "--current"}, offered, shell.__name__)
            self.assertNotIn("--csv", offered)

    def test_every_shell_offers_options_and_levels_of_the_gateway(self):
        self.assertLessEqual({"--check", "--listen-only"}, self.bash("iwheel-gateway", "--", program="_iwheel_program"))
        for shell in self.shells():
            more = {"program": "_iwheel_program"} if shell == self.bash else {}
            self.assertLessEqual({"error", "warning", "debug"}, shell("iwheel-gateway", "--log-level", "", **more), shell.__name__)

    def test_lists_are_those_of_the_program(self):
        self.assertLessEqual(set(ITEMS), set(listed("confirm")))
        counted = subprocess.run(
            ["grep", "-c", "IW_ASSUMPTION_", os.path.join(ROOT, "core", "include", "iwheel", "types.h")], capture_output=True, text=True, check=True
        )
        self.assertGreater(int(counted.stdout), len(ITEMS))
        for verb in verbs():
            for word in listed(verb):
                if word.startswith("--"):
                    self.assertIn(word, run("help", verb)[1] + "--help --json --socket", (verb, word))
