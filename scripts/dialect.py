#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""One dialect of C over the whole tree: what the compiler takes either way is written one way.

usage: dialect.py --check|--fix [ROOT]

    i++;                            not ++i; where the value is not used
    x = (a < b) ? y : z;            a condition that compares or combines stands in parentheses
    sizeof x, sizeof(type_t)        parentheses only around types
    memset(...);                    mem* without (void): its result says nothing
    NAME_OF_FILE_H                  ends the include guard of name_of_file.h
"""
import re
import sys
from pathlib import Path

FOLDERS = ("core", "port", "lib", "app", "test", "examples")
# Comments, strings, characters, preprocessor lines; words; operators.
TOKEN = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'|^[ \t]*#(?:[^\n]*\\\n)*[^\n]*|\w+|->|\+\+|--|<<=|>>=|<<|>>|&&|\|\||[<>=!+\-*/%&|^]=|.',
                   re.DOTALL | re.MULTILINE)
COMPARES = {"==", "!=", "<", ">", "<=", ">=", "&&", "||"}
ASSIGNS = {"=", "+=", "-=", "*=", "/=", "%=", "&=", "|=", "^=", "<<=", ">>="}
OPEN, CLOSE = "([{", ")]}"
INCREMENT = re.compile(r"(?P<before>(?:^[ \t]*|for \([^\n]*; ))(?P<operator>\+\+|--)(?P<what>[A-Za-z_][\w.\->]*(?:\[[^\]\n]+\](?:[.\w\->]*))*)(?P<after>;|\) \{)", re.MULTILINE)
SIZEOF = re.compile(r"\bsizeof\(([a-z_][\w.\->]*(?:\[[^\]\n]*\])?)\)")
TYPE = re.compile(r"\w+_t$|(?:char|int|long|short|unsigned|float|double|bool|void)$|T$")
VOID_MEM = re.compile(r"\(void\)(mem(?:set|cpy|move)\()")


def is_code(token):
    return not (token.isspace() or token.startswith(("//", "/*")) or token.lstrip().startswith("#"))


def condition_before(tokens, at):
    """(first, last) index of the condition of the `?` at that index, and whether it compares or combines outside parentheses."""
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
    """Not in a macro, whose arguments need theirs."""
    line = found.string[found.string.rfind("\n", 0, found.start()) + 1:found.end()]
    before = found.string[:found.start() - len(line) + len(found[0])].rstrip("\n")
    in_macro = line.lstrip().startswith("#") or before.endswith("\\")
    return found[0] if in_macro or TYPE.search(found[1]) else f"sizeof {found[1]}"


def rewrite(text):
    text = INCREMENT.sub(r"\g<before>\g<what>\g<operator>\g<after>", text)
    text = SIZEOF.sub(without_parentheses, text)
    text = VOID_MEM.sub(r"\1", text)
    return parenthesised(text)


def guard_finding(path, text):
    guard = re.search(r"^#ifndef (\w+)\n#define \1$", text, re.MULTILINE)
    wanted = re.sub(r"\W", "_", path.name).upper()
    return [] if guard and guard[1].endswith(wanted) else [f"the include guard must end in {wanted}"]


def main(arguments):
    if len(arguments) not in (2, 3) or arguments[1] not in ("--check", "--fix"):
        sys.exit(__doc__)
    root, findings = Path(arguments[2] if len(arguments) == 3 else Path(__file__).resolve().parent.parent), []
    for path in sorted(path for folder in FOLDERS for path in (root / folder).rglob("*.[ch]")):
        text = path.read_text()
        new = rewrite(text)
        if new != text and arguments[1] == "--fix":
            path.write_text(new)
        elif new != text:
            old, other = text.splitlines(), new.splitlines()
            findings += [f"{path.relative_to(root)}:{n}: write: {b.strip()}" for n, (a, b) in enumerate(zip(old, other, strict=False), 1) if a != b]
        if path.suffix == ".h":
            findings += [f"{path.relative_to(root)}: {finding}" for finding in guard_finding(path, text)]
    print(*findings, sep="\n")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
