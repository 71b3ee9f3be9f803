# SPDX-License-Identifier: MIT
"""The gateway built with libgpiod 2, where the system has libgpiod 1: the gateway must read the same line in the same way with both versions."""

import os
import re
import subprocess

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))


def generation(build):
    """The major version of libgpiod in the configuration of a build directory; None if it has none."""
    try:
        with open(os.path.join(build, "CMakeCache.txt"), encoding="utf-8") as file:
            found = re.search(r"^LIBGPIOD_VERSION:INTERNAL=(\d+)", file.read(), re.MULTILINE)
    except FileNotFoundError:
        return None
    return int(found.group(1)) if found else None


def last_line(command, **variables):
    """Runs it; returns the last line of its output. Raises RuntimeError with that line if it fails."""
    done = subprocess.run(command, cwd=ROOT, env={**os.environ, **variables}, text=True, check=False, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    lines = done.stdout.strip().splitlines() or [""]
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}: {lines[-1]}")
    return lines[-1]


def find_build(build, download=True):
    """A build directory next to `build`, whose gateway uses libgpiod 2. Created if missing. RuntimeError if that fails."""
    if generation(build) == 2:
        return build
    neighbour = os.path.join(os.path.dirname(os.path.abspath(build)), "gpiod2")
    library = [os.path.join(ROOT, "test", "kernel", "build_libgpiod2")] + ([] if download else ["--no-download"])
    configure = ["cmake", "-S", ROOT, "-B", neighbour, "-DCMAKE_BUILD_TYPE=RelWithDebInfo", "-DCMAKE_C_FLAGS_RELWITHDEBINFO=-O2 -DNDEBUG"]
    last_line(configure, PKG_CONFIG_PATH=last_line(library))
    last_line(["cmake", "--build", neighbour, "--target", "iwheel-gateway", "iwheel-sim", "-j", str(os.cpu_count())])
    if generation(neighbour) != 2:
        raise RuntimeError(f"{neighbour} was configured with libgpiod {generation(neighbour)}; remove it and try again")
    return neighbour
