#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Measures functions and files. Fails if a limit of the project's style is exceeded, if a comment contains a name that does not exist, or if C code with
two valid forms does not have the form of this tree:

    i++;                            not ++i; where the value is not used
    x = (a < b) ? y : z;            a condition that compares or combines is in parentheses
    sizeof x, sizeof(type_t)        parentheses only around types
    memset(...);                    mem* without (void): its result has no information
    NAME_OF_FILE_H                  ends the include guard of name_of_file.h
    telemetry, not told             no identifier contains a word of REPLACED

usage: style.py [--fix] [ROOT]      --fix writes that form

Needs lizard (PyPI), which measures functions. Tried: clang-tidy and clang-format 14 check only the length of functions and their parameters, and
clang-tidy does not compile the STM32 port.
"""

import re
import statistics
import sys
from pathlib import Path

import lizard

# group: (folders, longest function, median function, complexity)
GROUPS = {
    "core": (("core/src",), 60, 15, 10),
    "northbound": (("lib/northbound",), 60, 15, 10),
    "ports and apps": (("port", "lib/begin", "lib/client", "lib/config", "lib/inspect", "lib/recording", "lib/sockets", "app"), 80, 25, 15),
}
FILE_LINES = 400  # Lines with only a comment do not count: a reason must not cost anything.
TEST_FILE_LINES = 600  # Tables of cases may be longer than code.
LINE = 120
HEADERS = ("core/include", "lib/northbound/protocol/include")
COMMENTED = ("core", "port")  # Names in the comments of these must exist, their lines are not longer than LINE ...
COMMENT_SHARE = {"core/src": (5, 20), "port": (5, 20)}  # ... and this share of their sources' lines, in percent, are comments.
CODE = ("core", "port", "lib", "app", "zephyr")
PARAMETERS = 5
IMPOSED = ("web_call_handle",)  # A library calls these and defines their parameters.
SPDX = "SPDX-License-Identifier: MIT"
UNFINISHED = re.compile(r"\b(TODO|FIXME|XXX)\b")
STRING_OR_COMMENT = re.compile(r'"(?:\\.|[^"\\\n])*"|//[^\n]*|/\*.*?\*/', re.DOTALL)
NAMED = re.compile(r"\b(?:iw[lnc]?|IW[LNC]?|brd|BRD)_\w*[A-Za-z0-9]\b(?![*_])|(?<=`)[A-Za-z]\w+(?=(?:\(\))?`)|(?<=::)\w+")
FILE_NAMED = re.compile(r"(?<![\w/<-])[\w/-]+\.(?:[ch]|md)\b")
RULE_NAMED = re.compile(r"\bR\d+\b")
DIALECT = ("core", "port", "lib", "app", "test", "examples")
# Comments, strings, characters, preprocessor lines; words; operators.
TOKEN = re.compile(
    r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'|^[ \t]*#(?:[^\n]*\\\n)*[^\n]*|\w+|->|\+\+|--|<<=|>>=|<<|>>|&&|\|\||[<>=!+\-*/%&|^]=|.',
    re.DOTALL | re.MULTILINE,
)
COMPARES = {"==", "!=", "<", ">", "<=", ">=", "&&", "||"}
ASSIGNS = {"=", "+=", "-=", "*=", "/=", "%=", "&=", "|=", "^=", "<<=", ">>="}
OPEN, CLOSE = "([{", ")]}"
INCREMENT = re.compile(
    r"(?P<before>(?:^[ \t]*|for \([^\n]*; ))(?P<operator>\+\+|--)(?P<what>[A-Za-z_][\w.\->]*(?:\[[^\]\n]+\](?:[.\w\->]*))*)(?P<after>;|\) \{)", re.MULTILINE
)
SIZEOF = re.compile(r"\bsizeof\(([a-z_][\w.\->]*(?:\[[^\]\n]*\])?)\)")
TYPE = re.compile(r"\w+_t$|(?:char|int|long|short|unsigned|float|double|bool|void)$|T$")
# Words that are replaced in identifiers by the field's terms: telemetry, commanded, reported, printed; assumption, source, observation.
REPLACED = re.compile(
    r"\b\w*(?<![a-z])(?:told|untold|tells?|nobody|somebody|anew|keeper|knowledge|evidence|learnt|culprit|wish|heed)(?![a-z])\w*", re.IGNORECASE
)
VOID_MEM = re.compile(r"\(void\)(mem(?:set|cpy|move)\()")


def sources(root, folders):
    return sorted(path for folder in folders for path in (root / folder).rglob("*.[ch]"))


def function_findings(path, functions, limits):
    _, longest, _, complexity = limits
    for function in functions:
        where = f"{path}:{function.start_line}: {function.name}"
        if function.length > longest:
            yield f"{where}: {function.length} lines, at most {longest}"
        if function.cyclomatic_complexity > complexity:
            yield f"{where}: complexity {function.cyclomatic_complexity}, at most {complexity}"
        if len(function.parameters) > PARAMETERS and function.name not in IMPOSED:
            yield f"{where}: {len(function.parameters)} parameters, at most {PARAMETERS}"


def file_findings(path, name, longest=FILE_LINES):
    lines = path.read_text().splitlines()
    length = sum(not line.lstrip().startswith("//") for line in lines)
    if length > longest:
        yield f"{name}: {length} lines without comments, at most {longest}"
    if not lines or SPDX not in lines[0]:
        yield f"{name}:1: the first line must be // {SPDX}"
    for number, line in enumerate(lines, 1):
        if UNFINISHED.search(line):
            yield f"{name}:{number}: unfinished: {line.strip()}"


def known_names(root):
    """Returns the names that a comment may contain: (identifiers of the code, names of files, rules of the safety case)."""
    paths = sources(root, CODE)
    code = "".join(STRING_OR_COMMENT.sub(" ", path.read_text()) for path in paths)
    documents = [str(path.relative_to(root)) for path in (root / "docs").rglob("*.md")]
    safety_case = root / "docs/developer/safety-case.md"
    rules = re.findall(r"^### (R\d+) ", safety_case.read_text(), re.MULTILINE) if safety_case.is_file() else []
    return set(re.findall(r"\w+", code)), {path.name for path in paths} | set(documents), set(rules)


def dangling(path, name, known):
    """Yields lines that are too long, and names in comments that do not exist, because an outdated comment misleads."""
    identifiers, files, rules = known
    for number, line in enumerate(path.read_text().splitlines(), 1):
        if len(line) > LINE:
            yield f"{name}:{number}: {len(line)} characters, at most {LINE}"
        comment = " ".join(found for found in STRING_OR_COMMENT.findall(line) if found.startswith("/"))
        gone = [found for found in NAMED.findall(comment) if found not in identifiers]
        gone += [found for found in FILE_NAMED.findall(comment) if found not in files and Path(found).name not in files]
        gone += [found for found in RULE_NAMED.findall(comment) if found not in rules]
        for found in gone:
            yield f"{name}:{number}: names {found}, which does not exist"


def comment_share(paths):
    """Returns the percentage of non-empty lines that are comments, over all files together, without the line of the licence."""
    lines = [line.strip() for path in paths for line in path.read_text().splitlines() if line.strip() and SPDX not in line]
    comments = sum(line.startswith(("//", "/*")) or "///<" in line for line in lines)
    return 100 * comments / max(len(lines), 1)


def is_code(token):
    return not (token.isspace() or token.startswith(("//", "/*")) or token.lstrip().startswith("#"))


def condition_before(tokens, at):
    """Returns (first, last) index of the condition of the `?` at that index, and whether it compares or combines outside parentheses."""
    depth, compares, first, last, i = 0, False, at, None, at - 1
    while i >= 0:
        token = tokens[i]
        if is_code(token):
            if token in CLOSE:
                depth += 1
            elif token in OPEN:
                if depth == 0:
                    break
                depth -= 1
            elif depth == 0 and (token in ASSIGNS or token in ",;?:" or token == "return"):
                break
            compares = compares or (depth == 0 and token in COMPARES)
            last = i if last is None else last
            first = i
        i -= 1
    return first, last, compares


def parenthesised(text):
    tokens = TOKEN.findall(text)
    opens, closes = {}, {}
    for at, token in enumerate(tokens):
        if token == "?":
            first, last, compares = condition_before(tokens, at)
            if compares:
                opens[first] = opens.get(first, 0) + 1
                closes[last] = closes.get(last, 0) + 1
    return "".join("(" * opens.get(i, 0) + token + ")" * closes.get(i, 0) for i, token in enumerate(tokens))


def without_parentheses(found):
    """Removes parentheses after sizeof. Not in a macro, whose arguments need them."""
    line = found.string[found.string.rfind("\n", 0, found.start()) + 1 : found.end()]
    before = found.string[: found.start() - len(line) + len(found[0])].rstrip("\n")
    in_macro = line.lstrip().startswith("#") or before.endswith("\\")
    return found[0] if in_macro or TYPE.search(found[1]) else f"sizeof {found[1]}"


def rewrite(text):
    text = INCREMENT.sub(r"\g<before>\g<what>\g<operator>\g<after>", text)
    text = SIZEOF.sub(without_parentheses, text)
    text = VOID_MEM.sub(r"\1", text)
    return parenthesised(text)


def dialect_findings(path, name, fix):
    text = path.read_text()
    new = rewrite(text)
    if fix and new != text:
        path.write_text(new)
    elif new != text:
        yield from (f"{name}:{n}: write: {b.strip()}" for n, (a, b) in enumerate(zip(text.splitlines(), new.splitlines(), strict=False), 1) if a != b)
    guard = re.search(r"^#ifndef (\w+)\n#define \1$", text, re.MULTILINE)
    wanted = re.sub(r"\W", "_", path.name).upper()
    if path.suffix == ".h" and not (guard and guard[1].endswith(wanted)):
        yield f"{name}: the include guard must end in {wanted}"
    for found in sorted(set(REPLACED.findall(STRING_OR_COMMENT.sub(" ", text)))):
        yield f"{name}: {found}: use the field's term (REPLACED in scripts/style.py)"


def main(arguments):
    if "--help" in arguments:
        print(__doc__)
        return 0
    fix, places = "--fix" in arguments, [word for word in arguments[1:] if word != "--fix"]
    root = Path(places[0] if places else Path(__file__).resolve().parent.parent).resolve()
    findings = [finding for path in sources(root, DIALECT) for finding in dialect_findings(path, path.relative_to(root), fix)]
    for group, limits in GROUPS.items():
        measured = {path: lizard.analyze_file(str(path)).function_list for path in sources(root, limits[0])}
        lengths = [function.length for functions in measured.values() for function in functions]
        if not lengths:
            sys.exit(f"{group}: no function found in {', '.join(limits[0])}")
        for path, functions in measured.items():
            findings += [*function_findings(path.relative_to(root), functions, limits), *file_findings(path, path.relative_to(root))]
        median = statistics.median(lengths)
        findings += [f"{group}: the median function has {median} lines, at most {limits[2]}"] if median > limits[2] else []
        print(
            f"{group}: {len(lengths)} functions in {len(measured)} files, lines: median {median:g}, max {max(lengths)}; comments {comment_share(measured):.0f} %"
        )
    for path in sources(root, HEADERS):
        findings += function_findings(path.relative_to(root), lizard.analyze_file(str(path)).function_list, GROUPS["core"])
        findings += file_findings(path, path.relative_to(root))
    known = known_names(root)
    for path in sources(root, COMMENTED):
        findings += dangling(path, path.relative_to(root), known)
    for folder, (least, most) in COMMENT_SHARE.items():
        share = comment_share([path for path in sources(root, (folder,)) if path.suffix == ".c"])
        print(f"{folder}: {share:.1f} % of the sources' lines are comments")
        if not least <= share <= most:
            findings.append(f"{folder}: {share:.1f} % comments, between {least} and {most} % wanted")
    for path in sources(root, ("test",)):
        findings += file_findings(path, path.relative_to(root), TEST_FILE_LINES)
    print(*findings, sep="\n")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
