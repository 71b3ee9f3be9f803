# SPDX-License-Identifier: MIT
"""What a person always sees on the first screen: figures without scrolling, STOP in every state of the page, and the pad with all that belongs to it."""

import contextlib
import json
import math
import re
import threading
import time

import pytest
from bus import now_us
from judge_log import LEFT, RIGHT
from test_bridge import start_lan
from test_browser import SIZES, brakes_ms, latch, live, live_page, middle_of, mouse_on_stop, page_of, press_stop, record_a_stop, seen, shot, turns
from trials import RECENT_US, Driver, until

PHONES = {"portrait": (390, 844), "landscape": (844, 390), "small": (320, 568)}
SIZES.update(PHONES)
NO_FIGURE = "\N{EN DASH}"
SIZES["wide"] = (1400, 900)
VIEWS = [*PHONES, "wide"]
FIGURES = ["big-left-speed", "big-right-speed", "big-left-force", "big-right-force", "big-left-battery", "big-right-battery", "big-estop"]

# Of each element: whether its whole area is in the window, what lies on its middle, and whether its words are cut off.
AREAS = """(ids) => ids.map((id) => { const e = document.getElementById(id), r = e.getBoundingClientRect();
  const top = document.elementFromPoint(r.left + r.width / 2, r.top + r.height / 2);
  return { id, text: e.textContent, inside: r.width > 0 && r.height > 0 && r.left >= 0 && r.top >= 0 && r.right <= innerWidth && r.bottom <= innerHeight,
    card: !e.closest('.card') || r.right <= e.closest('.card').getBoundingClientRect().right, free: top === e || e.contains(top),
    whole: e.scrollWidth <= e.clientWidth + 1 || getComputedStyle(e).display === 'inline', size: parseFloat(getComputedStyle(e).fontSize) }; })"""


def touch(size):
    return {} if size == "wide" else {"is_mobile": True, "has_touch": True}


# Cells of the assumptions that a person sees only after scrolling to the right.
CELLS_OUTSIDE = """[...document.querySelectorAll('#ledger :is(th, td)')].filter((one) => one.getBoundingClientRect().right >
  document.querySelector('#ledger').closest('.card').getBoundingClientRect().right).map((one) => one.textContent)"""


def all_seen(page, ids, what):
    for area in page.evaluate(AREAS, ids):
        assert area["inside"] and area["card"] and area["free"] and area["whole"] and area["text"].strip(), (what, area)


@pytest.mark.rig(driving=True)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_state_figures_and_last_stop_are_on_the_first_screen(rig, scheme):
    for size in VIEWS:
        with live_page(rig, size, scheme, **touch(size)) as page:
            all_seen(page, ["word", "sentence", "last-stop", *FIGURES, "stop", "estop-ask"], size)
            assert page.inner_text("#word") == "Ready" and page.evaluate("document.querySelector('#now').dataset.tone") == "good"
            assert min(area["size"] for area in page.evaluate(AREAS, FIGURES)) >= 20, size
            assert page.evaluate("scrollY") == 0
            shot(page, f"ready-{size}-{scheme}")
    rig.sim.ask("estop press")
    until(lambda: rig.ask_json("GET", "/api/stops")[1]["stops"], what="the stop is known")
    for size in VIEWS:
        with live_page(rig, size, scheme, **touch(size)) as page:
            seen(page, "document.querySelector('#last-stop').textContent.includes('e-stop pressed')")
            all_seen(page, ["word", "sentence", "reset", "last-stop", *FIGURES, "stop"], size)
            assert page.inner_text("#word") == "Latched" and "press Reset" in page.inner_text("#sentence")
            assert page.inner_text("#big-estop") == "PRESSED" and "iwheelctl" not in page.inner_text("#now")
            shot(page, f"latched-{size}-{scheme}")


def test_machine_that_rolls_away_is_not_ready(rig):
    with live_page(rig, "portrait", **touch("portrait")) as page:
        assert page.inner_text("#word") == "Ready"
        rig.sim.ask("slope 10")
        seen(page, "document.querySelector('#word').textContent === 'Rolling' && document.querySelector('#now').dataset.tone === 'bad'")
        assert "parking brake" in page.inner_text("#sentence") and "ready:" not in page.text_content("#advice")


def test_large_figures_are_those_of_the_snapshot(rig):
    with live_page(rig, "portrait", **touch("portrait")) as page:
        driver = Driver(rig, 200)
        for unit, factor, digits in (("m/s", 0.001, 2), ("km/h", 0.0036, 1)):
            page.select_option("#units", unit)
            until(lambda: page.evaluate("page.state.left.speed_mm_s") > 150, what="it drives")
            state, read = page.evaluate(
                "() => { show(); return [page.state, Object.fromEntries([...document.querySelectorAll('[id^=big-]')].map((e) => [e.id, e.textContent]))]; }"
            )
            for side in ("left", "right"):
                assert read[f"big-{side}-speed"] == f"{state[side]['speed_mm_s'] * factor:.{digits}f}" and read["big-unit"] == unit, read
                force, volts = state[side]["force_net_mN"], state[side]["battery_dV"]
                assert read[f"big-{side}-force"] == (f"{force / 1000:.1f}".replace("-0.0", "0.0") if force is not None else NO_FIGURE), (read, force)
                assert read[f"big-{side}-battery"] == f"{volts / 10:.1f}", read
            assert read["big-estop"] == "released" and read["big-simulated"] == "simulated"
            assert page.inner_text("#word") == "Driving" and "Joystick drives" in page.inner_text("#sentence").capitalize()
        driver.end()
        rig.kill_gateway(9)
        seen(page, "document.querySelector('#news').className === 'bad'")
        assert page.inner_text("#word") == "Unknown"
        assert {page.inner_text(f"#{one}") for one in FIGURES} == {NO_FIGURE, "unknown"}, "what is not known is no figure"


# ---- STOP -----------------------------------------------------------------------------------------------------------


@pytest.mark.rig(driving=True)
@pytest.mark.parametrize("size", VIEWS)
def test_stop_is_usable_above_dialogs_zoomed_and_in_large_text(rig, size):
    with live_page(rig, size, **touch(size)) as page:
        for zoom, text in ((1, 100), (3.3, 100), (1, 200)):
            page.evaluate(f"document.documentElement.style.fontSize = '{text}%'")
            for button in ("#estop-ask", "#arm"):
                page.evaluate(f"document.querySelector('{button}').click()")
                page.context.new_cdp_session(page).send("Emulation.setPageScaleFactor", {"pageScaleFactor": zoom})
                time.sleep(0.3)
                shot(page, f"stop-{size}-{zoom}-{text}-{button[1:]}")
                assert page.evaluate("document.querySelector('#ask').open")
                press_stop(page, rig)
                assert not page.evaluate("document.querySelector('#ask').open"), "STOP closes the question with no"
            box = page.evaluate(
                "(() => { const r = document.querySelector('#stop').getBoundingClientRect(), v = visualViewport; return [r.width / v.width, r.height * v.scale]; })()"
            )
            assert box[1] >= 44 or zoom > 1, (size, zoom, text, box)
            page.context.new_cdp_session(page).send("Emulation.setPageScaleFactor", {"pageScaleFactor": 1})


@pytest.mark.rig(driving=True)
def test_stop_cancels_the_question_of_reset(rig):
    with live_page(rig, "small", **touch("small")) as page:
        latch(rig, page)
        for zoom, text in ((1, 100), (3.3, 100), (1, 200)):
            page.evaluate(f"document.documentElement.style.fontSize = '{text}%'; document.querySelector('#reset').click()")
            page.context.new_cdp_session(page).send("Emulation.setPageScaleFactor", {"pageScaleFactor": zoom})
            time.sleep(0.3)
            assert page.evaluate("document.querySelector('#ask').open")
            page.evaluate("showResult('')")
            mouse_on_stop(page, "Pressed")
            seen(page, "!document.querySelector('#ask').open && document.querySelector('#delivered').textContent.startsWith('Stop delivered')")
            mouse_on_stop(page, "Released")
            assert rig.ask_json("GET", "/api/status")[1]["state"] == "latched"


def test_two_fingers_do_not_zoom_the_page(rig):
    with live_page(rig, "portrait", **touch("portrait")) as page:
        session = page.context.new_cdp_session(page)
        for selector in ("#word", "#figures", "#stop", "#left .plot [role=img]"):
            page.locator(selector).first.scroll_into_view_if_needed()
            x, y = middle_of(page, f"{selector} >> nth=0")
            session.send("Input.synthesizePinchGesture", {"x": x, "y": y, "scaleFactor": 3.3, "gestureSourceType": "touch"})
            assert page.evaluate("visualViewport.scale") == 1, selector


def test_stop_is_first_in_the_tab_order(rig):
    with live_page(rig) as page:
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.id") == "stop"
        driver = Driver(rig)
        assert brakes_ms(rig, lambda: page.keyboard.press("Enter")) < 500
        driver.end()


def test_page_has_no_bar_across_in_any_size_and_text(rig):
    for size in VIEWS:
        with live_page(rig, size, **touch(size)) as page:
            for text in (100, 200):
                page.evaluate(f"document.documentElement.style.fontSize = '{text}%'")
                time.sleep(0.2)
                wide = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
                assert wide <= 0, (size, text, wide)
                assert page.evaluate(CELLS_OUTSIDE) == [], (size, text)
                shot(page, f"assumptions-{size}-{text}", "#ledger")


def test_stop_of_the_page_is_quick_while_ninety_others_poll(rig):
    rig.web_settings["web"]["max_connections"] = 200
    rig.start().connected()
    over = threading.Event()

    def poll():
        while not over.is_set():
            with contextlib.suppress(OSError):
                rig.ask("GET", "/api/challenge", token="", timeout=2)
            over.wait(0.2)

    pollers = [threading.Thread(target=poll, daemon=True) for _ in range(90)]
    with live_page(rig, "portrait", **touch("portrait")) as page:
        for one in pollers:
            one.start()
        time.sleep(1)
        press_stop(page, rig)
        over.set()
        for one in pollers:
            one.join(5)


# ---- the pad --------------------------------------------------------------------------------------------------------


def switch_on(page):
    page.click("#arm")
    page.click("#ask-yes")
    page.wait_for_selector("#pad:visible")


@pytest.mark.rig(driving=True)
def test_pad_in_each_size_is_visible_with_state_and_estop(rig):
    for size in VIEWS:
        with live_page(rig, size, **touch(size)) as page:
            switch_on(page)
            time.sleep(0.3)
            names = ["pad-word", "pad-estop", "pad-command", "pad-measured", "pad-limit", "pad-off"]
            all_seen(page, names, size)
            pad, bar = page.locator("#pad").bounding_box(), page.locator("#bar").bounding_box()
            assert min(pad["width"], pad["height"]) >= 150 and abs(pad["width"] - pad["height"]) < 2, (size, pad)
            assert pad["x"] + pad["width"] <= bar["x"] + (0 if bar["x"] else 10**6) and (bar["x"] or pad["y"] + pad["height"] <= bar["y"]), (size, pad, bar)
            page.mouse.move(pad["x"] + pad["width"] * 0.35, pad["y"] + pad["height"] * 0.3)
            page.mouse.down()
            turns(rig)
            seen(page, "!document.querySelector('#ring').hidden && parseFloat(document.querySelector('#pad-measured').textContent) > 0.05")
            shot(page, f"pad-{size}")
            for words in page.evaluate("['pad-command', 'pad-measured', 'pad-limit'].map((id) => document.getElementById(id).textContent)"):
                assert re.fullmatch(r"-?\d\.\d\d m/s, -?\d+\s°/s", words), (size, words)
            page.mouse.up()
            rig.at_standstill()
            page.click("#pad-off")
            assert page.evaluate("!drive.on && document.activeElement.id === 'arm'")


def commanded(rig):
    """The newest setpoints, left and right; no number for a wheel that was sent none for a second."""
    newest = {wheel: speed for _, wheel, speed in rig.bus.setpoints(now_us() - RECENT_US)[-8:]}
    return newest.get(LEFT, math.nan), newest.get(RIGHT, math.nan)


@pytest.mark.rig(driving=True)
def test_pad_with_two_keys_drives_a_curve_until_one_is_released(rig):
    with live_page(rig) as page:
        switch_on(page)
        page.keyboard.down("ArrowUp")
        until(lambda: min(commanded(rig)) > 100, what="straight ahead")
        page.keyboard.down("ArrowLeft")
        until(lambda: commanded(rig)[1] - commanded(rig)[0] > 80, what="a curve to the left")
        assert sum(commanded(rig)) > 200
        page.keyboard.up("ArrowLeft")
        until(lambda: min(commanded(rig)) > 100 and abs(commanded(rig)[1] - commanded(rig)[0]) < 10, what="straight ahead again")
        assert brakes_ms(rig, lambda: page.keyboard.up("ArrowUp")) < 500


def fingers(session, kind, *places):
    """Fingers that touch, move or leave: a touch belongs to the session that began it."""
    points = [{"x": x, "y": y, "id": i} for i, (x, y) in enumerate(places)]
    session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})


@pytest.mark.rig(driving=True)
def test_pad_by_touch_drives_and_a_second_finger_stops(rig):
    with live_page(rig, "portrait", **touch("portrait")) as page:
        switch_on(page)
        session = page.context.new_cdp_session(page)
        box = page.locator("#pad").bounding_box()
        one = (box["x"] + box["width"] / 2, box["y"] + box["height"] * 0.25)
        for second, begins in (((one[0] + 60, one[1] + 60), "on the pad"), ((20, 20), "elsewhere")):
            fingers(session, "touchStart", one)
            turns(rig)
            assert brakes_ms(rig, lambda: fingers(session, "touchStart", one, second)) < 500, begins
            seen(page, "document.querySelector('#pad-says').textContent.includes('second finger')")
            fingers(session, "touchMove", (one[0] + 5, one[1]), second)
            rig.at_standstill()
            assert not page.evaluate("drive.held"), "a finger that stayed does not drive again"
            fingers(session, "touchEnd")
            time.sleep(0.6)


@pytest.mark.rig(driving=True)
def test_reset_on_the_first_screen_clears_the_latch(rig):
    with live_page(rig, "small", **touch("small")) as page:
        latch(rig, page)
        time.sleep(1.2)
        page.tap("#reset")
        page.tap("#ask-yes")
        seen(page, "document.querySelector('#word').textContent === 'Ready'")


def test_token_is_kept_and_can_be_forgotten(rig):
    with live_page(rig) as page:
        page.goto("about:blank")
        page.goto(rig.url.split("#")[0])
        live(page)
        page.click("#forget")
        page.wait_for_selector("#login:not([hidden])")
        assert "no token" in page.inner_text("#login-says")
        assert json.loads(page.evaluate("JSON.stringify(localStorage)")).get("token", "") == ""
        page.reload()
        page.wait_for_selector("#login:not([hidden])")
        page.fill("#token", "0" * 32)
        page.keyboard.press("Enter")
        seen(page, "document.querySelector('#login-says').textContent.includes('not valid')")


# ---- languages ------------------------------------------------------------------------------------------------------

# Name and {gaps} of each text, of one language.
SHAPE = """(language) => { const walk = (value, name) => typeof value === 'object' ? Object.entries(value).flatMap(([key, one]) => walk(one, `${name}.${key}`))
  : [name + ' ' + (value.match(/\\{\\w+\\}/g) ?? []).sort().join()]; return walk(LANGUAGES[language], ''); }"""


def test_languages_have_the_same_texts_with_the_same_gaps(rig):
    rig.start()
    with page_of(rig) as page:
        languages = page.evaluate("Object.keys(LANGUAGES)")
        english = page.evaluate(SHAPE, "en")
        assert len(languages) >= 2 and len(english) > 200
        for one in languages:
            assert sorted(page.evaluate(SHAPE, one)) == sorted(english), one


@pytest.mark.rig(driving=True)
def test_page_in_german_browser_is_german_english_on_request(rig):
    rig.start().connected()
    rig.sim.ask("estop press")
    until(lambda: rig.ask_json("GET", "/api/stops")[1]["stops"], what="the stop is known")
    for size in VIEWS:
        with live_page(rig, size, locale="de-AT", **touch(size)) as page:
            seen(page, "document.querySelector('#last-stop').textContent.includes('Not-Halt')")
            all_seen(page, ["word", "sentence", "reset", "last-stop", *FIGURES, "stop"], size)
            assert page.inner_text("#word") == "Gesperrt" and page.evaluate("document.documentElement.lang") == "de"
            assert page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") <= 0, size
            shot(page, f"german-{size}")
    with live_page(rig, locale="fr-FR") as page:
        assert page.inner_text("#word") == "Latched"
        for language, word in (("de", "Gesperrt"), ("en", "Latched")):
            with page.expect_navigation():  # The page loads again.
                page.select_option("#language", language)
            seen(page, f"document.querySelector('#word')?.textContent === '{word}'")


# ---- plots ----------------------------------------------------------------------------------------------------------


FORCES_SHOWN = "plots.left.force.lines.map((line) => plots.left.force.shows(line))"  # Raw force, zero, net force.


def scale(page, side, what, axis="x"):
    return page.evaluate(f"[plots.{side}.{what}.uplot.scales.{axis}.min, plots.{side}.{what}.uplot.scales.{axis}.max]")


def test_plots_have_common_axes_spans_and_marks(rig):
    with live_page(rig) as page:
        page.evaluate("document.querySelector('#tools').scrollIntoView()")
        driver = Driver(rig, 200)  # The start of a browser may stall a small machine for longer than the driver's lease.
        rig.sim.ask("load left 30")
        time.sleep(1.5)
        rig.ask("POST", "/api/stop")
        seen(
            page,
            "view.live_marks.some((one) => one.words === STRINGS.causes.client_stop) && view.live_marks.some((one) => one.words === STRINGS.states.listening)",
        )
        driver.end()
        page.click("#freeze")
        time.sleep(0.5)
        for what in ("speed", "force"):
            assert scale(page, "left", what, "y") == scale(page, "right", what, "y"), what
        assert scale(page, "left", "speed", "y")[1] > 150
        assert page.evaluate(FORCES_SHOWN) == [False, False, True]
        page.click("#forces")
        assert page.evaluate("plots.right.force.lines.every((line) => plots.right.force.shows(line))")
        page.click("#freeze")
        for seconds in (10, 600, 60):
            page.click(f"#spans [data-seconds='{seconds}']")
            seen(page, f"Math.abs(plots.right.force.uplot.scales.x.max - plots.right.force.uplot.scales.x.min - {seconds}) < 0.01")
            assert page.get_attribute(f"#spans [data-seconds='{seconds}']", "aria-pressed") == "true"
        assert page.inner_text("#left .plot .measured b").lstrip("-").isdigit()


def test_plots_are_dragged_and_pinched_by_touch(rig):
    with live_page(rig, "portrait", **touch("portrait")) as page:
        page.click("#freeze")
        page.locator("#left .plot .canvas").first.scroll_into_view_if_needed()
        time.sleep(0.5)
        middle, y = middle_of(page, "#left .plot .canvas >> nth=0")
        session = page.context.new_cdp_session(page)
        before = scale(page, "left", "speed")
        fingers(session, "touchStart", (middle, y))
        for step in range(1, 6):
            fingers(session, "touchMove", (middle + step * 20, y))
        fingers(session, "touchEnd")
        seen(page, f"plots.right.speed.uplot.scales.x.max < {before[1] - 5}")
        moved = scale(page, "left", "speed")
        assert abs((moved[1] - moved[0]) - (before[1] - before[0])) < 0.01, "dragged, not zoomed"
        fingers(session, "touchStart", (middle - 30, y), (middle + 30, y))
        for step in range(1, 6):
            fingers(session, "touchMove", (middle - 30 - step * 10, y), (middle + 30 + step * 10, y))
        fingers(session, "touchEnd")
        seen(page, f"plots.left.speed.uplot.scales.x.max - plots.left.speed.uplot.scales.x.min < {(moved[1] - moved[0]) / 2}")
        assert page.evaluate("visualViewport.scale") == 1


def test_recording_starts_at_0_and_shows_no_live_values(rig):
    record_a_stop(rig)
    with live_page(rig) as page:
        assert page.locator("#left > details").is_visible()
        page.click("#recordings button:text-is('Open')")
        page.wait_for_selector("#player:not([hidden])")
        seen(page, "!document.querySelector('#left .at').hidden")
        at, zero = page.evaluate("[parseFloat(document.querySelector('#left .at').style.left), plots.left.speed.uplot.valToPos(0, 'x')]")
        assert abs(float(page.input_value("#at"))) <= 0.01 and abs(at - zero) < 1, (at, zero)
        assert page.evaluate("view.marks.some((one) => one.words === STRINGS.causes.estop_line)")
        assert not page.locator("#left > details").is_visible() and not page.locator("#right > details").is_visible()
        page.evaluate("goTo(-0.03)")
        assert int(page.inner_text("#left .plot .measured b")) > 150, "the value at the cursor"
        assert page.evaluate(FORCES_SHOWN)[0], "a recording has raw forces only"
        shot(page, "recording")
        page.click("#live")
        assert page.evaluate(FORCES_SHOWN) == [False, False, True]
        assert page.locator("#left > details").is_visible() and page.evaluate("document.querySelector('#left .at').hidden")


def test_page_of_the_lan_is_live_and_an_app(rig):
    """As a phone opens it from the QR code, past the browser's warning."""
    rig.start_gateway()
    url, _ = start_lan(rig)
    with live_page(rig, "portrait", url=url, ignore_https_errors=True, **touch("portrait")) as page:
        assert page.evaluate("isSecureContext") and "token" not in page.url
        manifest = page.evaluate("fetch(document.querySelector('link[rel=manifest]').href).then((answer) => answer.json())")
        assert manifest["display"] == "standalone" and manifest["start_url"] == "/"
        assert page.evaluate("fetch('/icon.svg').then((answer) => answer.headers.get('Content-Type'))") == "image/svg+xml"
        page.goto(page.url)  # Opened again without the token in its address, as the app is.
        live(page)


def test_cause_that_prevents_driving_is_one_sentence(rig):
    with live_page(rig, "small", **touch("small")) as page:
        rig.sim.ask("power off")
        seen(page, "document.querySelector('#word').textContent === 'Not ready'")
        assert page.inner_text("#sentence") == "Wheel offline: switch the wheels on; check their cable and the termination."
        assert {page.inner_text(f"#big-{side}-speed") for side in ("left", "right")} == {NO_FIGURE}
        all_seen(page, ["word", "sentence", *FIGURES], "wheels without power")


@pytest.mark.rig(driving=True)
def test_pad_closes_when_the_bridge_forbids_driving(rig):
    with live_page(rig, "portrait", **touch("portrait")) as page:
        switch_on(page)
        rig.end_web()
        rig.web_settings["drive"] = {"enabled": "no"}
        rig.start_web()
        live(page)
        seen(page, "!drive.on && document.querySelector('#drive').hidden")
        all_seen(page, ["word", "sentence", *FIGURES, "stop"], "without the pad")
        page.said.clear()  # The browser's own message about the lost connection.
