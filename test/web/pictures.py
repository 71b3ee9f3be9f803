#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Makes the pictures of docs/user/web.md, with a machine that drives.

usage: test/web/pictures.py BUILD FOLDER
"""

import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "system")]

from test_browser import SIZES, live, page_of
from trials import Driver
from web_rig import WebRig


def take_pictures(build, folder):
    folder.mkdir(parents=True, exist_ok=True)
    for size in SIZES:
        for scheme in ("light", "dark"):
            rig = WebRig(build)
            try:
                rig.start().connected()
                driver = Driver(rig, 300)
                with page_of(rig, size, scheme) as page:
                    live(page)
                    for speed in (300, 150, 350, 250):
                        driver.speed = speed
                        time.sleep(2)
                    page.evaluate("goLive(); moveView(0.35, 0.2)")
                    time.sleep(0.5)
                    page.screenshot(path=folder / f"web-{size}-{scheme}.png")
                driver.end()
            finally:
                rig.close()


if __name__ == "__main__":
    take_pictures(Path(sys.argv[1]), Path(sys.argv[2]))
