#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Are the pages for those who come next true? The lists of docs/how-to-add.md, and the indexes of test/, scripts/ and docs/.

usage: pages.py [ROOT]

A list of docs/how-to-add.md stands below a comment `<!-- pattern: REGEX  in: PLACE... -->`: the files in those places that have the
pattern are those whose names stand in the list, each after its number. A file of test/ may be named too, and must have it then.
"""
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).resolve().parent.parent).resolve()
PAGE = "docs/how-to-add.md"
MARK = re.compile(r"<!-- pattern: (.+?)  in: (.+?) -->\n")


def files(*places):
    """What git knows or would add; without git everything there."""
    run = subprocess.run(["git", "-C", ROOT, "ls-files", "-co", "--exclude-standard", "--", *places], capture_output=True, text=True, check=False)
    names = run.stdout.split("\n") if run.returncode == 0 else [
        str(path.relative_to(ROOT)) for place in places for path in ([ROOT / place] if (ROOT / place).is_file() else (ROOT / place).rglob("*"))]
    return sorted(name for name in set(names) if name and (ROOT / name).is_file())


def line_of(name, pattern):
    """The first line with the pattern, as "12: text"; None: there is none."""
    try:
        text = (ROOT / name).read_text(encoding="utf-8")
    except (UnicodeDecodeError, FileNotFoundError):
        return None
    found = re.search(pattern, text)
    if not found:
        return None
    number = text.count("\n", 0, found.start())
    return f"{number + 1}: {text.splitlines()[number].strip()[:80]}"


def moved_to(name):
    same = [other for other in files(".") if Path(other).name == Path(name).name and other != name]
    return f"; is it {' or '.join(same)} now?" if same else ""


def judge_list(title, section):
    mark = MARK.search(section)
    if not mark:
        return [f'{PAGE}, "{title}": the list has no comment `<!-- pattern: REGEX  in: PLACE... -->`']
    pattern, places = mark[1], mark[2].split()
    listed = [name for line in re.findall(r"^\d+\. .*$", section, re.MULTILINE) for name in re.findall(r"^\d+\. `([^`]+)`", line)]
    there = {name: line_of(name, pattern) for name in files(*places)}
    there = {name: line for name, line in there.items() if line}
    if not there and not listed:
        print(f'note: {PAGE}, "{title}": nothing in the tree is such a thing yet, and nothing is listed')
    where = f'{PAGE}, "{title}"'
    wrong = [f"{where}: add a numbered line for `{name}`, which has the pattern in line {line}" for name, line in there.items() if name not in listed]
    for name in listed:
        if not (ROOT / name).is_file():
            wrong.append(f"{where}: `{name}` is not there: take its line out, or name the file that does this now{moved_to(name)}")
        elif not line_of(name, pattern):
            wrong.append(f"{where}: take the line of `{name}` out: nothing in it is like {pattern} any more")
    wrong += [f"{where}: `{name}` is listed twice" for name in set(listed) if listed.count(name) > 1]
    beside = [name for name in re.findall(r"`([\w./-]+/[\w.-]+\.\w+)`", MARK.sub("", section)) if not (ROOT / name).exists()]
    return wrong + [f"{where}: `{name}` is not there{moved_to(name)}" for name in sorted(set(beside) - set(listed))]


def judge_how_to_add():
    text = (ROOT / PAGE).read_text(encoding="utf-8")
    sections = re.findall(r"^## (.+)\n((?:(?!^## ).*\n)*)", text, re.MULTILINE)
    found = [line for title, section in sections for line in judge_list(title, section)]
    return found if sections else [f"{PAGE}: no list is found"], len(sections)


def judge_index(folder):
    page = f"{folder}/README.md"
    indexed = re.findall(r"^\| `([^`]+)` \|", (ROOT / page).read_text(encoding="utf-8"), re.MULTILINE)
    parts = [name.split("/")[1:] for name in files(folder)]
    entries = {part[0] + ("/" if len(part) > 1 else "") for part in parts} - {"README.md"}
    wrong = [f"{page}: add a line `| \\`{name}\\` | what it is for |`" for name in sorted(entries - set(indexed))]
    return wrong + [f"{page}: take the line of `{name}` out: it is not there" for name in sorted(set(indexed) - entries)], len(entries)


def main():
    findings, lists = judge_how_to_add()
    for folder in ("test", "scripts", "docs"):
        more, entries = judge_index(folder)
        findings += more
        print(f"index of {folder}/: {entries} entries")
    print(f"{PAGE}: {lists} lists")
    print(*findings, sep="\n")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
