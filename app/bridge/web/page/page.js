// SPDX-License-Identifier: MIT
"use strict";
// Sets up the parts of the page, and paints them.

const plots = {};
let path;

function setUpWheel(side) {
  const card = $(side), label = (name) => fill(STRINGS[name], { side: STRINGS[side] });
  plots[side] = {
    speed: new Plot(card, STRINGS.speed_plot, label("speed_label"), [
      { name: "wanted", label: STRINGS.wanted, column: "commanded_mm_s", dash: [2, 4] }, { name: "applied", label: STRINGS.applied, column: "applied_mm_s", dash: [8, 4] },
      { name: "measured", label: STRINGS.measured, column: "measured_mm_s" }], `${side}-speed`),
    force: new Plot(card, STRINGS.force_plot, label("force_label"), [
      { name: "wanted", label: STRINGS.raw, column: "raw_N", dash: [2, 4], digits: 2, more: true },
      { name: "offset", label: STRINGS.offset, column: "offset_N", dash: [8, 4], digits: 2, more: true },
      { name: "measured", label: STRINGS.net, column: "net_N", digits: 2 }], `${side}-force`),
  };
  card.append(element("details", {}, element("summary", { text: say("figures_of", { side: STRINGS[side] }) }), element("dl", { class: "facts" }, ...figures.map(([name]) =>
    element("div", {}, element("dt", { text: STRINGS[name] }), element("dd", { id: `${side}-${name}` }))))));
}

function setUp() {
  takeToken();
  setUpWheel("left");
  setUpWheel("right");
  path = new Path($("pose"));
  $("pose").setAttribute("aria-label", STRINGS.pose_label);
  $("at").setAttribute("aria-label", STRINGS.player_label);
  $("source").textContent = STRINGS.source_live;
  setUpDriving();
  setUpLanguage($("language"));
  choose($("units"), Object.keys(UNITS).map((one) => [one, one]), unit, (one) => { unit = one; storage.write("units", one); show(); });
  $("forget").addEventListener("click", () => { setToken(""); askToken(); });
  $("last-stop").addEventListener("click", () => { document.querySelector("#stops [aria-expanded='false']")?.click(); });
  $("freeze").addEventListener("click", freeze);
  $("record").addEventListener("click", switchRecord);
  $("live").addEventListener("click", goLive);
  $("forces").addEventListener("click", () => showAllForces(!showsAllForces()));
  for (const one of $("spans").children) one.addEventListener("click", () => showSpan(Number(one.dataset.seconds)));
  $("play").addEventListener("click", playOn);
  $("at").addEventListener("input", () => goTo(Number($("at").value)));
  $("pose-clear").addEventListener("click", () => path.clear());
  $("files").addEventListener("change", (event) => openFiles(event.target.files));
  $("job-end").addEventListener("click", endJob);
  $("login").addEventListener("submit", (event) => {
    event.preventDefault();
    setToken($("token").value.trim());
    listen();
  });
  window.addEventListener("blur", () => letGo("why_hidden"));
  window.addEventListener("pagehide", () => letGo("why_hidden"));
  document.addEventListener("visibilitychange", () => {
    letGo("why_hidden");
    if (document.hidden) page.stream?.abort(); else { page.wait = 100; listen(); }
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { view.plots.forEach((plot) => plot.build()); path.dirty = true; });
  if (!proof.token) askToken();
  listen();
  setInterval(show, 200);
  let rest = []; // What is drawn in the next frames, because one frame must not take long.
  const paint = () => {
    const begun = performance.now();
    // Ten minutes are many points: 20 ms are not visible in them.
    if (!rest.length && (begun - paint.last >= (view.span_s > 60 ? 500 : 50) || view.plots.some((plot) => plot.forced))) {
      paint.last = begun;
      rest = [...view.plots, path];
    }
    while (rest.length && performance.now() - begun < STEP_MS) rest.shift().draw();
    requestAnimationFrame(paint);
  };
  paint.last = 0;
  requestAnimationFrame(paint);
}

setUp();
