# SPDX-License-Identifier: MIT
"""The Python package as a person installs it: source package and wheel, their metadata, and the tests from the source package."""

import ast
import email
import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.exact
ROOT = Path(__file__).resolve().parents[2]
VERSIONS = [(3, minor) for minor in range(10, 15)]


def run(*words, **more):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, timeout=300, check=False, **more)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Builds both from a copy, because setuptools writes into the source folder."""
    folder = tmp_path_factory.mktemp("package")
    shutil.copytree(ROOT / "python", folder / "python", ignore=shutil.ignore_patterns("__pycache__", "*.egg-info", ".mypy_cache", "build"))
    run(sys.executable, "-m", "build", "--no-isolation", "--outdir", folder / "dist", folder / "python")
    return folder / "dist"


@pytest.fixture(scope="module")
def sources(built, tmp_path_factory):
    folder = tmp_path_factory.mktemp("sources")
    with tarfile.open(next(built.glob("*.tar.gz"))) as archive:
        archive.extractall(folder, filter="data")
    return next(folder.iterdir())


def metadata(wheel):
    with zipfile.ZipFile(wheel) as archive:
        name = next(name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        return email.message_from_bytes(archive.read(name)), archive.namelist()


def test_package_passes_twine_check(built):
    said = run(sys.executable, "-m", "twine", "check", "--strict", *sorted(built.iterdir()))
    assert said.count("PASSED") == 2


def test_wheel_is_pure_and_has_a_licence_expression(built):
    (wheel,) = built.glob("*.whl")
    assert wheel.name.endswith("-py3-none-any.whl")
    head, names = metadata(wheel)
    assert head["License-Expression"] == "MIT"
    assert head["License"] is None
    assert not [line for line in head.get_all("Classifier") if line.startswith("License ::")]
    assert head.get_all("License-File") == ["LICENSE"]
    assert {f"iwheel/{path.name}" for path in (ROOT / "python/src/iwheel").glob("*.py")} <= set(names)
    assert "iwheel/py.typed" in names


def test_package_names_the_supported_versions(built):
    head, _ = metadata(next(built.glob("*.whl")))
    stated = re.findall(r"Python :: 3\.(\d+)", " ".join(head.get_all("Classifier")))
    assert [(3, int(minor)) for minor in stated] == VERSIONS
    assert head["Requires-Python"] == ">=3.10"


def test_licence_is_that_of_the_project():
    assert (ROOT / "python/LICENSE").read_bytes() == (ROOT / "LICENSE").read_bytes()


def test_sources_parse_with_the_oldest_version():
    for path in (ROOT / "python/src/iwheel").glob("*.py"):
        ast.parse(path.read_text(encoding="utf-8"), feature_version=VERSIONS[0])


def test_wheel_imports_with_each_python_of_this_machine(built):
    (wheel,) = built.glob("*.whl")
    tried = []
    for major, minor in VERSIONS:
        python = shutil.which(f"python{major}.{minor}") or ""
        names = "import iwheel, iwheel.export, iwheel.plot, sys; print(*sys.version_info[:2], sep='.')"
        done = subprocess.run([python or "false", "-c", names], env={**os.environ, "PYTHONPATH": str(wheel)}, capture_output=True, text=True, check=False)
        if not python or "pyenv" in done.stderr:
            continue  # Not installed.
        assert done.stdout.strip() == f"{major}.{minor}", done.stderr
        tried.append(f"{major}.{minor}")
    assert tried, "no supported python on this machine"


def test_tests_of_the_source_package_pass_from_it(sources):
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHONPATH", "IWHEEL"))}
    said = run(sys.executable, "-m", "unittest", "discover", "-s", "tests", cwd=sources, env=environment)
    ran = int(re.search(r"^Ran (\d+) tests?", said, re.MULTILINE).group(1))
    skipped = int((re.search(r"skipped=(\d+)", said) or [0, 0])[1])
    assert ran - skipped >= 30, said[-2000:]
    assert (sources / "examples" / "recording.ipynb").is_file()
