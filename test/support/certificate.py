# SPDX-License-Identifier: MIT
"""Keys and certificates of a test, by openssl."""

import subprocess

NEW_KEY = "req -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes"


def openssl(folder, command):
    """Runs it in the folder; no word has a space."""
    done = subprocess.run(["openssl", *command.split()], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def self_signed(folder, name, subject, more=""):
    openssl(folder, f"{NEW_KEY} -x509 -days 2 -subj /CN={subject} -keyout {name}.key -out {name}.pem {more}")
