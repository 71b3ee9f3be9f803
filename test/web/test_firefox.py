# SPDX-License-Identifier: MIT
"""The page in Debian's Firefox. Pinch and drag of the plots are tested in Chromium only: WebDriver BiDi has no gesture of two fingers that zooms."""

import json
import os
import time
from pathlib import Path

import pytest
from bus import now_us
from firefox import ASSETS, firefox_page
from test_browser import LONG, SIZES, record_a_stop, turns
from test_first_screen import AREAS, FIGURES, VIEWS
from trials import Driver, braking_ms, until

ZOOMED = (1400 * 10 // 33, 900 * 10 // 33)  # What a window on a desk shows at a zoom of 3.3.
LIVE = "document.querySelector('#news').className === 'good'"


def shot(page, name, whole=False):
    if os.environ.get("IWHEEL_WEB_SHOTS"):
        page.picture(Path(os.environ["IWHEEL_WEB_SHOTS"]) / f"firefox-{name}.png", whole)


def all_seen(page, ids, what):
    for area in page.evaluate(f"({AREAS})({json.dumps(ids)})"):
        assert area["inside"] and area["card"] and area["free"] and area["whole"] and area["text"].strip(), (what, area)


@pytest.mark.rig(driving=True)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_firefox_first_screen_has_state_and_figures(rig, scheme):
    rig.start().connected()
    rig.sim.ask("estop press")
    until(lambda: rig.ask_json("GET", "/api/stops")[1]["stops"], what="the stop is known")
    with firefox_page(rig.url, *SIZES["portrait"], scheme) as page:
        page.seen(LIVE)
        page.seen("document.querySelector('#last-stop').textContent.includes('e-stop pressed')")
        for size in VIEWS:
            page.size(*SIZES[size])
            page.seen(f"innerWidth === {SIZES[size][0]} && innerHeight === {SIZES[size][1]}")
            all_seen(page, ["word", "sentence", "reset", "last-stop", *FIGURES, "stop"], size)
            assert page.text("#word") == "Latched" and page.text("#big-estop") == "PRESSED"
            assert page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") <= 0, size
            shot(page, f"latched-{size}-{scheme}")
        axe = ASSETS / "axe-core-4.14.1/axe.min.js"
        if axe.is_file():
            page.run(axe.read_text(encoding="utf-8"))
            found = page.evaluate("axe.run(document, {resultTypes: ['violations']})")["violations"]
            assert not found, [(one["id"], [node["target"] for node in one["nodes"]][:4]) for one in found]


@pytest.mark.rig(driving=True)
def test_firefox_stop_acts_by_each_input_above_dialogs(rig):
    rig.start().connected()
    with firefox_page(rig.url, *SIZES["small"]) as page:
        page.seen(LIVE)
        for text, question, way, size in (
            (100, "#estop-ask", "mouse", SIZES["small"]),
            (200, "#arm", "touch", SIZES["small"]),
            (100, "#arm", "s", ZOOMED),
            (200, "#estop-ask", "click", SIZES["small"]),
            (100, "#estop-ask", "mouse", ZOOMED),
        ):
            page.size(*size)
            page.seen(f"innerWidth === {size[0]}")
            page.run(f"document.documentElement.style.fontSize = '{text}%'")
            page.run(f"document.querySelector('{question}').click()")
            page.seen("document.querySelector('#ask').open")
            all_seen(page, ["stop"], (text, question))
            shot(page, f"stop-{text}-{question[1:]}-{size[0]}")
            driver = Driver(rig)
            since = now_us()
            if way in ("mouse", "touch"):
                page.pointer(way, page.middle("#stop"), "down")
            elif way == "click":  # As a screen reader does. A Firefox without a window has no focus, so Enter presses no button.
                page.run("document.querySelector('#stop').click()")
            else:
                page.key(way)
            late = braking_ms(rig, since)
            assert late < 1000, f"{way}: {late} ms"
            page.let_go()
            assert not page.evaluate("document.querySelector('#ask').open"), "STOP closes the question with no"
            page.seen("document.querySelector('#delivered').textContent.startsWith('Stop delivered')")
            driver.end()
            driver.client.close()
            rig.at_standstill()


@pytest.mark.rig(driving=True)
def test_firefox_pad_drives_by_touch_until_released(rig):
    rig.start().connected()
    with firefox_page(rig.url, *SIZES["portrait"]) as page:
        page.seen(LIVE)
        page.click("#arm")
        page.click("#ask-yes")
        page.seen("drive.on")
        x, y = page.middle("#pad")
        for end in ("released", "second finger", "view"):
            page.pointer("touch", (x, y - 80), "down")
            page.pointer("touch", (x + 2, y - 82))
            turns(rig)
            shot(page, "pad")
            since = now_us()
            if end == "released":
                page.pointer("touch", "up")
            elif end == "second finger":
                page.pointer("touch", (20, 20), "down", finger=1)
            else:
                page.size(*SIZES["landscape"])
            late = braking_ms(rig, since)
            assert late < 1000, f"{end}: {late} ms"
            assert not page.evaluate("drive.held"), end
            page.let_go()
            rig.at_standstill()
            until(lambda: rig.ask_json("GET", "/api/status")[1]["lease"]["holder"] is None, what="no client drives")


def test_firefox_plays_a_recording_and_speaks_german(rig):
    record_a_stop(rig, "jsonl_bytes", 0)
    with firefox_page(rig.url, *SIZES["portrait"], language="de-AT, de") as page:
        page.seen(LIVE)
        assert page.text("#word") == "Gesperrt" and page.evaluate("document.documentElement.lang") == "de"
        page.seen("document.querySelector('#recordings button') !== null")
        page.click("#recordings button")
        page.seen("!document.querySelector('#player').hidden && !document.querySelector('#left .at').hidden")
        assert not page.evaluate("document.querySelector('#left > details').checkVisibility()"), "no live figure under the heading of a recording"
        page.run("goTo(-0.03)")
        page.seen("parseInt(document.querySelector('#left .plot .measured b').textContent) > 100")
        assert page.text("#happened li:last-child").endswith("s: gesperrt") and "Not-Halt gedrückt" in page.text("#happened")
        shot(page, "recording")
        page.click("#live")
        page.seen("document.querySelector('#player').hidden")
        page.run(LONG)
        page.run("setTimeout(() => document.querySelector('#recordings [data-ending=mcap]').click())")
        for _ in range(5):
            page.key("s")
            time.sleep(0.1)
        late = sorted(page.evaluate("late"))
        print(f'        from the press to "Stop delivered": {late} ms', flush=True)
        assert late and late[-1] < 200 and late[len(late) // 2] < 100, late
        page.seen("document.querySelector('#job').hidden")
