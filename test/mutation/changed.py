# SPDX-License-Identifier: MIT
"""What git knows for a run that judges only a sample of mutants: it judges those of changed functions first, and the commit selects the others."""

import subprocess
import tempfile
from pathlib import Path

from mutants import ROOT, functions

COMMITS = 30


def git(*words):
    return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=False).stdout


def commit():
    """Names the tree of the commit; empty without git."""
    return git("rev-parse", "HEAD^{tree}").strip()


def changed_functions():
    """{(file, function)} that differ from the last tag or from COMMITS commits ago; empty without history."""
    base = git("describe", "--tags", "--abbrev=0").strip() or git("rev-list", f"--max-count={COMMITS}", "HEAD").split()[-1:]
    base = base[0] if isinstance(base, list) and base else base
    if not base:
        return set()
    found = set()
    with tempfile.TemporaryDirectory() as folder:
        for line in git("diff", "--name-status", "-M", base, "--", "*.c").splitlines():
            kind, *paths = line.split("\t")
            now, before = ROOT / paths[-1], Path(folder, Path(paths[0]).name)
            before.write_text("" if kind == "A" else git("show", f"{base}:{paths[0]}"))
            old = functions(before)
            found |= {(paths[-1], name) for name, text in (functions(now).items() if now.exists() else ()) if old.get(name) != text}
    return found
