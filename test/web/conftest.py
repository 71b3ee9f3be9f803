# SPDX-License-Identifier: MIT
"""The web bridge on simulated wheels: its replies, the rights of its clients, its cost for the gateway (test_bridge.py), and its page in two real browsers.

The browsers are Debian's chromium-headless-shell by PyPI's playwright (test_browser.py, test_first_screen.py), and Debian's firefox-esr by WebDriver BiDi
(test_firefox.py); the judge of accessibility axe-core (scripts/web_assets --test). What is missing is skipped, and
said so.
"""

import pytest
from web_rig import WebRig


@pytest.fixture
def rig(make_rig):
    return make_rig(WebRig)
