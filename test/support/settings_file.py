# SPDX-License-Identifier: MIT
"""A program's configuration file."""

from pathlib import Path


def write_settings(path, settings):
    """{section: {key: value}}"""
    text = "".join(f"[{section}]\n" + "".join(f"{key} = {value}\n" for key, value in keys.items()) for section, keys in settings.items())
    Path(path).write_text(text, encoding="utf-8")
