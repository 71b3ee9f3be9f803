# SPDX-License-Identifier: MIT
"""All mutants of a file of the core in one library, so that judging one costs no compilation.

Of each function there is one copy per mutant beside the one as it is; under the function's own name stands a switch. Which
mutant is in force is told by the environment when the library is loaded.
"""
import re

from core_build import NUMBER, Core
from mutants import function_spans

HEAD = """extern char *getenv(const char *);
extern int atoi(const char *);
static int iw_mutant;
__attribute__((constructor)) static void iw_choose_mutant(void) { const char *text = getenv("%s"); iw_mutant = text ? atoi(text) : 0; }
""" % NUMBER


def argument_names(signature):
    names = [re.search(r"(\w+)\s*(?:\[[^\]]*\]\s*)*$", part)[1] for part in signature[signature.index("(") + 1:signature.rindex(")")].split(",")]
    return [name for name in names if name != "void"]


def copies(source, name, span, numbered):
    """The function's text `numbered` times: [(number, text)], and the switch."""
    at = source.index("{\n", span[0])
    signature = " ".join(source[span[0]:at].split())
    own = signature if signature.startswith("static ") else f"static {signature}"
    call = f"({', '.join(argument_names(signature))});"
    back = "" if re.match(r"(static )?void \w", signature) else "return "
    found = [(0, f"{own.replace(f'{name}(', f'{name}__0(', 1)} {source[at:span[1]]}\n")]
    for number, mutant in numbered:
        body = source[at:mutant.begin] + mutant.text + source[mutant.end:span[1]]
        found.append((number, f"{own.replace(f'{name}(', f'{name}__{number}(', 1)} {body}\n"))
    cases = "".join(f" case {number}: {back}{name}__{number}{call} break;" for number, _ in numbered)
    return found, f"{signature} {{ switch (iw_mutant) {{{cases} default: {back}{name}__0{call} }} }}"


def compose(source, numbered):
    """(the text of the file with all of them, [(first line, last line, number)] of the copies)"""
    text, lines, last = HEAD, [], 0
    for name, span in sorted(function_spans(source).items(), key=lambda item: item[1]):
        mine = [(number, mutant) for number, mutant in numbered if mutant.function == name]
        if not mine:
            continue
        found, switch = copies(source, name, span, mine)
        text += source[last:span[0]]
        for number, copy in found:
            begin = text.count("\n") + 1
            text += copy
            lines.append((begin, text.count("\n"), number))
        text, last = text + switch, span[1]
    return text + source[last:], lines


def build(judges, name, path, mutants):
    """{mutant: its core, or None if it does not compile}"""
    source, invalid = path.read_text(), set()
    while True:
        numbered = [(number, mutant) for number, mutant in enumerate(mutants, 1) if number not in invalid]
        text, lines = compose(source, numbered)
        core, said = judges.change(name, path.name, text)
        if core:
            return {mutant: None if number in invalid else Core(core.folder, number) for number, mutant in enumerate(mutants, 1)}
        wrong = {int(line) for line in re.findall(rf"{re.escape(path.name)}:(\d+):\d+: error:", said)}
        found = {number for begin, end, number in lines if number and any(begin <= line <= end for line in wrong)}
        if not found:
            raise RuntimeError(said)
        invalid |= found
