#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Inside the kernel of test/kernel: runs the attempts of pytest's tests that a plan of pytest_virtual.py lists.

usage: guest_pytest.py PLAN.json
"""

import ctypes
import json
import os
import sys
from pathlib import Path

TMP = "/tmp"


def mount(source, folder, kind, data):
    if ctypes.CDLL(None, use_errno=True).mount(source, os.fsencode(folder), kind, 0, os.fsencode(data)) != 0:
        raise OSError(ctypes.get_errno(), f"mount {folder}")


def own_tmp(folders):
    """Mounts a /tmp of this kernel, in which there can be sockets; needed files of the host stay in their places."""
    mount(b"tmpfs", TMP, b"tmpfs", "mode=1777")
    for folder in folders:
        if folder.startswith(f"{TMP}/"):
            Path(folder).mkdir(parents=True, exist_ok=True)
            mount(b"none", folder, b"hostfs", folder)


def main(path):
    plan = json.loads(Path(path).read_text(encoding="utf-8"))
    if sys.executable != plan["python"]:
        os.execv(plan["python"], [plan["python"], "-u", __file__, path])  # Python must have the packages of its environment.
    own_tmp([*plan["folders"], str(Path(path).parent)])
    os.environ.update(plan["environment"])
    os.chdir(plan["root"])
    import pytest

    return pytest.main([*plan["arguments"], "-p", "no:cacheprovider", "--inside", path])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
