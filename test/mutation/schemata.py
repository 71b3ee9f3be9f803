# SPDX-License-Identifier: MIT
"""All mutants of a file of the core in one library, so that judging one costs no compilation.

The library contains one copy of each function per mutant and one unchanged copy; under the name of the function there is a switch.
An environment variable selects the mutant when the library is loaded. A mutant of a function in a header is enabled in every source
that includes the header, test programs too.
"""

import re

from core_build import NUMBER
from mutants import function_spans

WHICH = f"""extern char *getenv(const char *);
extern int atoi(const char *);
int iw_mutant;
__attribute__((constructor)) static void iw_choose_mutant(void) {{ const char *text = getenv("{NUMBER}"); iw_mutant = text ? atoi(text) : 0; }}
"""
SELECTED = "extern int iw_mutant;\n"


def argument_names(signature):
    names = [re.search(r"(\w+)\s*(?:\[[^\]]*\]\s*)*$", part)[1] for part in signature[signature.index("(") + 1 : signature.rindex(")")].split(",")]
    return [name for name in names if name != "void"]


def copies(source, name, span, numbered):
    """The function's text `numbered` times: [(number, text)], and the switch between them."""
    at = source.index("{\n", span[0])
    signature = " ".join(source[span[0] : at].split())
    own = signature if signature.startswith("static ") else f"static {signature}"
    call = f"({', '.join(argument_names(signature))});"
    back = "" if re.match(r"(static )?(inline )?void \w", signature) else "return "
    found = [(0, f"{own.replace(f'{name}(', f'{name}__0(', 1)} {source[at : span[1]]}\n")]
    for number, mutant in numbered:
        body = source[at : mutant.begin] + mutant.text + source[mutant.end : span[1]]
        found.append((number, f"{own.replace(f'{name}(', f'{name}__{number}(', 1)} {body}\n"))
    cases = "".join(f" case {number}: {back}{name}__{number}{call} break;" for number, _ in numbered)
    return found, f"{signature} {{ switch (iw_mutant) {{{cases} default: {back}{name}__0{call} }} }}"


def compose(source, numbered, head):
    """(the text of the file with all mutants, [(first line, last line, number)] of the copies)"""
    text, lines, last = head, [], 0
    for name, span in sorted(function_spans(source).items(), key=lambda item: item[1]):
        mine = [(number, mutant) for number, mutant in numbered if mutant.function == name]
        if not mine:
            continue
        found, switch = copies(source, name, span, mine)
        text += source[last : span[0]]
        for number, copy in found:
            begin = text.count("\n") + 1
            text += copy
            lines.append((begin, text.count("\n"), number))
        text, last = text + switch, span[1]
    return text + source[last:], lines


def build(judges, name, paths, mutants):
    """{mutant: its core, or None if it does not compile}; for one source, or for headers."""
    headers, invalid = paths[0].suffix == ".h", set()
    while True:
        composed, lines = {}, []
        for path in paths:
            mine = [(number, mutant) for number, mutant in enumerate(mutants, 1) if number not in invalid and mutant.file == path.name]
            composed[path], own = compose(path.read_text(), mine, SELECTED if headers else WHICH)
            lines += [(path.name, *line) for line in own]
        if headers:
            core, output = judges.change_headers(name, composed, WHICH)
        else:
            core, output = judges.change(name, paths[0].name, composed[paths[0]])
        if core:
            return {mutant: None if number in invalid else core._replace(number=number) for number, mutant in enumerate(mutants, 1)}
        wrong = {(file, int(line)) for file, line in re.findall(r"^\S*?([^\s/]+):(\d+):\d+: error:", output, re.M)}
        found = {number for file, begin, end, number in lines if number and any(file == other and begin <= line <= end for other, line in wrong)}
        if not found:
            raise RuntimeError(output)
        invalid |= found
