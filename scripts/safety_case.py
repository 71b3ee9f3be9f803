#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Fails unless docs/developer/safety-case.md is right: every name on it exists, every rule has code and a test, every seeded fault has a rule.
Also fails unless each interface of the threat model in docs/developer/threat-model.md has tests that exist.

usage: safety_case.py [--update]

--update writes the lists of seeded faults and of the fault catalogue's tests, which are generated from the sources.
The last line is "N passed, N failed, N skipped". No tool does it: doorstop and StrictDoc (PyPI) store requirements and links in files of their own form,
and do not know seeded faults.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE, THREATS = ROOT / "docs/developer/safety-case.md", ROOT / "docs/developer/threat-model.md"
sys.path.insert(0, str(ROOT / "test/faults"))
import table

FAULTS = sorted({*range(1, 35)} - {31})  # The rows of the fault catalogue; the page describes the effect of each.
INTERFACES = 11
# Rows whose tests have other names.
OTHER_TESTS = {
    21: ("sim.directed",),
    26: ("hang",),
    34: (
        "test_one_person_arm_too_old_changes_nothing",
        "test_one_person_reset_too_old_does_not_clear_the_latch",
        "test_one_person_confirm_too_old_is_refused",
        "test_one_person_burst_of_old_requests_changes_nothing",
        "test_one_person_reset_of_another_stop_does_not_clear_latch",
        "test_one_person_board_refuses_late_requests",
    ),
}
# More tests of a row, by the first part of their names, in addition to those that begin with rowNN_.
PREFIXES = {32: "test_one_person_", 33: "test_stop_never_"}


def defined_tests():
    """Returns the names of all tests, in C and in Python."""
    names = set()
    for path in (ROOT / "test").rglob("*.c"):
        names.update(re.findall(r"^(?:static void |TEST\()(test_\w+)(?:\(void)?\) \{", path.read_text(), re.M))
    for path in [*(ROOT / "test").rglob("*.py"), *(ROOT / "test").glob("*/run")]:
        names.update(re.findall(r"^ *def (\w+)\(|^(\w+)\(\) \{$", path.read_text(), re.M))
    return {name for found in names for name in ([found] if isinstance(found, str) else found)}


def oracle_rules():
    """Returns the numbers of all rules whose violation the oracle and the rigs can detect."""
    numbers = set()
    for folder in ("sim", "orders"):
        for path in (ROOT / "test" / folder).glob("*.c"):
            text = path.read_text()
            numbers.update(re.findall(r"oracle_break\(self, now_us, (\d+)", text))
            numbers.update(re.findall(r"judge_start\(self, now_us, (\d+)", text))
            numbers.update(re.findall(r"#define RULE_\w+\s+(\d+)U", text))
    return numbers


def sections(text):
    """Returns {rule: {kind of line: the rest of that line}}."""
    found = {}
    for rule, body in re.findall(r"^### (R\d+) .*?\n(.*?)(?=^##)", text, re.M | re.S):
        found[rule] = dict(re.findall(r"^- (code|oracle|tests|faults): (.+)$", body, re.M))
    return found


def bugs_of(rule, bugs):
    return [bug.name for bug in bugs if bug.rule == rule]


def has_function(file, name):
    path = ROOT / "core/src" / file
    return path.exists() and re.search(rf"^[\w \*]*\b{name}\(", path.read_text(), re.M) is not None


def rule_findings(rule, entry, tests, bugs):
    for what in ("code", "oracle", "tests", "faults"):
        if what not in entry:
            yield f"{rule}: no line '- {what}: ...'"
            return
    for file, name in re.findall(r"`(\w+\.c): (\w+)`", entry["code"]):
        if not has_function(file, name):
            yield f"{rule}: core/src/{file} has no function {name}"
    named = re.findall(r"`(\w+)`", entry["tests"])
    for name in named:
        if name not in tests:
            yield f"{rule}: there is no test {name}"
    if not named or "`" not in entry["code"]:
        yield f"{rule}: without code or test"
    if not re.match(r"none, ", entry["faults"]) and set(re.findall(r"`([\w-]+)`", entry["faults"])) != set(bugs_of(rule, bugs)):
        yield f"{rule}: test/faults has other seeded faults; scripts/safety_case.py --update writes them"
    if re.match(r"none, ", entry["faults"]) and bugs_of(rule, bugs):
        yield f"{rule}: the page has no seeded fault, but test/faults has some"


def findings(text, tests, bugs, rules):
    found = sections(text)
    for rule, entry in found.items():
        yield from rule_findings(rule, entry, tests, bugs)
    for bug in bugs:
        if bug.rule not in found and not any(ROOT.glob(f"docs/*/{bug.rule}.md")):
            yield f"seeded fault {bug.name} belongs to {bug.rule}, which is neither on this page nor a page of docs/"
    stated = set(re.findall(r"\d+", " ".join(entry.get("oracle", "") for entry in found.values())))
    yield from (f"rule {number} of the oracle belongs to no rule on this page" for number in sorted(rules - stated))
    yield from (f"the oracle has no rule {number}" for number in sorted(stated - rules))
    answered = re.findall(r"^\| (H\d+) .*\| (R\d+(?:, R\d+)*) \|$", text, re.M)
    for hazard, by in answered:
        yield from (f"{hazard}: {rule} is not on this page" for rule in by.split(", ") if rule not in found)
    yield from (f"{rule} answers no hazard" for rule in found if not any(rule in by.split(", ") for _, by in answered))
    for number in FAULTS:
        row = re.search(rf"^\| {number} \|[^|]*\|([^|]*)\|$", text, re.M)
        names = re.findall(r"`([^`]+)`", row[1]) if row else []
        if not names:
            yield f"fault {number}: no test"
        yield from (
            f"fault {number}: there is no test {name}; scripts/safety_case.py --update writes the list"
            for name in names
            if "." not in name and name not in tests
        )


def threat_findings(text, tests):
    """Yields the faults of the threat model: interfaces with an empty cell, and tests that do not exist."""
    rows = re.findall(r"^\| ([^|]+) \|([^|]*)\|([^|]*)\|([^|]*)\|([^|]*)\|([^|]*)\|$", text.partition("## Threats,")[2].partition("\n## ")[0], re.M)[1:]
    for interface, who, _, stops, remains, tested in rows:
        named = re.findall(r"`(\w+)`", tested)
        yield from (f"threat model, {interface}: there is no test {name}" for name in named if name not in tests)
        if not named or not all(cell.strip() for cell in (who, stops, remains)):
            yield f"threat model, {interface}: an empty cell"
    if len(rows) < INTERFACES:
        yield f"threat model: {len(rows)} of {INTERFACES} interfaces have a row"


def catalogue(text, tests):
    rows = ["| fault | what happens | tests |", "|---|---|---|"]
    for number in FAULTS:
        begins = (f"row{number:02d}_", PREFIXES.get(number, f"row{number:02d}_"))
        names = [name for name in sorted(tests) if name.startswith(begins)] + [*OTHER_TESTS.get(number, ())]
        what = re.search(rf"^\| {number} \|([^|]*)\|", text, re.M)
        rows.append(f"| {number} |{what[1] if what else ' '}| {', '.join(f'`{name}`' for name in names)} |")
    return "\n".join(rows)


def update(text, tests, bugs):
    def listed(match):
        names = bugs_of(match[2], bugs)
        return match[1] + (", ".join(f"`{name}`" for name in names) if names else match[3])

    text = re.sub(r"(^### (R\d+) (?:(?!^###).)*?^- faults: )([^\n]*)", listed, text, flags=re.M | re.S)
    return re.sub(r"^\| fault \| what happens.*?(?=\n\n)", lambda _: catalogue(text, tests), text, flags=re.M | re.S)


def self_test(text, tests, bugs, rules):
    """Seeds faults in the page, and returns the number that is not found, and the number of all."""
    faults = [
        text.replace("`step.c: watch_loop`", "`step.c: watch_nothing`"),
        text.replace("`row01_client_killed`", "`row01_client_kissed`"),
        text.replace("- oracle: 101, ", "- oracle: "),
        text.replace("- oracle: 101, ", "- oracle: 101, 999, "),
        text.replace("`lease-endless`, ", ""),
        text.replace("| R13 |", "| R12 |"),
        text.replace("| R13 |", "| R14 |"),
        re.sub(r"^- tests: .*\n", "", text, count=1, flags=re.M),
        re.sub(r"^\| 18 \|.*\n", "", text, flags=re.M),
    ]
    missed = sum(fault == text or not list(findings(fault, tests, bugs, rules)) for fault in faults)
    page = THREATS.read_text()
    threats = [
        page.replace("`row20_odd_frames`", "`row20_even_frames`"),
        re.sub(r"^\| MQTT .*\n", "", page, flags=re.M),
        re.sub(r"(?m)^(\| CAN bus.*\|)[^|]*\|$", r"\1 |", page),
    ]
    return missed + sum(fault == page or not list(threat_findings(fault, tests)) for fault in threats), len(faults) + len(threats)


def main(arguments):
    bugs = table.load()
    if any(word != "--update" for word in arguments[1:]):
        sys.exit(__doc__)
    text, tests, rules = PAGE.read_text(), defined_tests(), oracle_rules()
    if "--update" in arguments:
        text = update(text, tests, bugs)
        PAGE.write_text(text)
    found = [*findings(text, tests, bugs, rules), *threat_findings(THREATS.read_text(), tests)]
    missed, seeded = self_test(text, tests, bugs, rules)
    print(*(f"failed: {finding}" for finding in found), sep="\n", end="\n" if found else "")
    if missed:
        print(f"failed: {missed} of {seeded} faults seeded in the page are not found")
    print(f"{len(sections(text))} rules, {len(bugs)} seeded faults, {len(rules)} rules of the oracle")
    print(f"{len(sections(text)) + seeded - missed - (1 if found else 0)} passed, {len(found) + missed} failed, 0 skipped")
    return 1 if found or missed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
