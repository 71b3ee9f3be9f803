#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Makes the pictures of docs/user/web.md, with a machine that drives; with --all those for a review instead: four sizes, both browsers.

usage: test/web/pictures.py [--all] BUILD FOLDER
"""

import contextlib
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "system")]

from firefox import firefox_page
from test_browser import SIZES, live, page_of
from test_first_screen import VIEWS, touch
from trials import Driver
from web_rig import WebRig

ATTEMPTS = 10


def picture_while_driving(build, path, size, scheme):
    """False if a busy machine stopped the wheels."""
    rig = WebRig(build)
    try:
        rig.start().connected()
        with page_of(rig, size, scheme) as page:
            live(page)
            time.sleep(1)  # The browser's start needs the processors.
            driver = Driver(rig, 300)
            for speed in (300, 150, 350, 250):
                driver.speed = speed
                time.sleep(2)
            page.evaluate("goLive(); moveView(0.35, 0.2)")
            time.sleep(0.5)
            page.screenshot(path=path)
            driven = rig.ask_json("GET", "/api/status")[1]["state"] == "armed" and not rig.ask_json("GET", "/api/stops")[1]["stops"]
            driver.end()
        return driven
    finally:
        rig.close()


def take_pictures(build, folder):
    for size in ("desk", "phone"):
        for scheme in ("light", "dark"):
            for _ in range(ATTEMPTS):
                with contextlib.suppress(AssertionError):  # The wheels are not even started.
                    if picture_while_driving(build, folder / f"web-{size}-{scheme}.png", size, scheme):
                        break
            else:
                raise SystemExit(f"web-{size}-{scheme}.png: the machine is too busy to drive without a stop; try again later")


def take_all(build, folder):
    """First screens of a latched machine; the whole page in Chromium."""
    rig = WebRig(build, driving=True)
    try:
        rig.start().connected()
        driver = Driver(rig, 300)
        rig.ask("POST", "/api/record?on=true")
        time.sleep(2)
        rig.sim.ask("estop press")
        driver.end()
        time.sleep(3)
        for scheme in ("light", "dark"):
            for size in VIEWS:
                with page_of(rig, size, scheme, **touch(size)) as page:
                    live(page)
                    time.sleep(1)
                    page.screenshot(path=folder / f"chromium-{size}-{scheme}.png")
                    page.screenshot(path=folder / f"chromium-{size}-{scheme}-whole.png", full_page=True)
            with firefox_page(rig.url, *SIZES["portrait"], scheme) as page:
                page.seen("document.querySelector('#news').className === 'good'")
                for size in VIEWS:
                    page.size(*SIZES[size])
                    time.sleep(1)
                    page.picture(folder / f"firefox-{size}-{scheme}.png")
    finally:
        rig.close()


if __name__ == "__main__":
    *options, where, into = sys.argv[1:]
    Path(into).mkdir(parents=True, exist_ok=True)
    (take_all if options == ["--all"] else take_pictures)(Path(where), Path(into))
