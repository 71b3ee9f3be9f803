// SPDX-License-Identifier: MIT
"use strict";
// The last stops, the list of recordings, and one of them played along the plots.

async function loadStops() {
  let stops;
  try {
    ({ stops } = await askJson("/api/stops"));
  } catch {
    return;
  }
  const newest = stops[0];
  page.stop = newest?.number ?? null;
  page.newest = newest;
  $("last-stop").textContent = newest ? fill(STRINGS.last_stop, { when: clock(newest.wall_us), cause: causeInWords(newest) }) : STRINGS.no_stops;
  const open = new Set([...document.querySelectorAll("#stops details[open]")].map((one) => one.dataset.number));
  $("stops").replaceChildren(...(stops.length ? stops.map((stop) => showStop(stop, open.has(String(stop.number)))) : [element("p", { text: STRINGS.no_stops, class: "quiet" })]));
}

// "e-stop pressed", "wheel offline (left)": a sentence with all figures stands in the list.
function causeInWords({ cause, side }) {
  const words = STRINGS.causes[cause] ?? cause;
  return side ? `${words} (${STRINGS.sides[side] ?? side})` : words;
}

function showStop(stop, isOpen) {
  const details = element("details", { "data-number": stop.number }, element("summary", { text: fill(STRINGS.stop_at, { when: when(stop.wall_us), sentence: stop.sentence }) }));
  details.addEventListener("toggle", () => {
    if (!details.open || details.children.length > 1) return;
    const [svg, frames] = drawFrames(stop), table = element("table");
    rows(table, [STRINGS.frame_time, STRINGS.frame_id, STRINGS.frame_data, STRINGS.frame_kind], frames.map((frame) => [frame.ms.toFixed(1), `${frame.id} ${IDS[frame.id] ?? ""}`, frame.data, frame.kind]));
    if (stop.recording) details.append(element("p", { text: fill(STRINGS.stop_recording, { name: stop.recording.split("/").pop() }) }));
    details.append(element("div", { class: "scroll", tabindex: "0", role: "group", "aria-label": STRINGS.frames_label }, svg, table));
  });
  details.open = isOpen;
  return details;
}

async function loadRecordings() {
  let found;
  try {
    ({ recordings: found } = await askJson("/api/recordings"));
  } catch (error) {
    $("recordings-says").textContent = fill(STRINGS.recordings_unknown, { why: error.message });
    return;
  }
  $("recordings-says").textContent = found.length ? "" : STRINGS.recordings_none;
  const endings = [["log", "log_bytes"], ["jsonl", "jsonl_bytes"], ["conf", "conf_bytes"]];
  $("recordings").replaceChildren(
    element("thead", {}, element("tr", {}, ...STRINGS.recording_head.map((cell) => element(cell ? "th" : "td", cell ? { text: cell, scope: "col" } : {})))),
    element("tbody", {}, ...[...found].reverse().map((one) => {
      const there = endings.filter(([, size]) => one[size] !== null).map(([ending]) => ending);
      const open = element("button", { type: "button", class: "small", text: STRINGS.recording_open, "aria-label": fill(STRINGS.recording_open_of, one) });
      open.addEventListener("click", () => openRecording(one.name, there));
      const saves = there.map((ending) => {
        const name = `${one.name}.${ending}`;
        const made = element("button", { type: "button", class: "small", text: `.${ending}`, "aria-label": fill(STRINGS.recording_save_of, { name }) });
        made.addEventListener("click", async () => { const blob = await load(name); if (blob) save(blob, name); });
        return made;
      });
      return element("tr", {}, element("th", { text: one.name, scope: "row" }), element("td", { text: one.cause }), element("td", { text: when(one.wall_us) }),
        element("td", { text: one.log_bytes === null ? STRINGS.unknown : String(one.log_bytes) }), element("td", {}, element("div", { class: "row" }, open, ...saves)));
    })));
}

async function load(name) {
  try {
    const blob = await readRecording(askJson, name, (percent) => { $("recordings-says").textContent = fill(STRINGS.recording_loading, { name, percent }); });
    $("recordings-says").textContent = "";
    return blob;
  } catch (error) {
    $("recordings-says").textContent = fill(STRINGS.recordings_unknown, { why: error.message });
    return null;
  }
}

async function openRecording(name, endings) {
  const files = {};
  for (const ending of endings) {
    const blob = await load(`${name}.${ending}`);
    if (!blob) return;
    files[ending] = await blob.text();
  }
  showRecording(name, files);
}

async function openFiles(list) {
  const files = {};
  let name = "";
  for (const file of list) {
    const found = /^(.*)\.(log|jsonl|conf)$/.exec(file.name);
    if (found) [name, files[found[2]]] = [found[1], await file.text()];
  }
  showRecording(name, files);
}

function showRecording(name, files) {
  const recording = decodeRecording(files);
  if (!recording) {
    $("recordings-says").textContent = fill(STRINGS.recording_bad, { name: name || STRINGS.unknown });
    return;
  }
  page.recording = recording;
  ["left", "right"].forEach((side, i) => {
    plots[side].speed.show(recording.wheels[i].speed);
    plots[side].force.show(recording.wheels[i].force);
  });
  Object.assign($("at"), { min: recording.first, max: recording.last, value: recording.first });
  $("source").textContent = fill(STRINGS.recording_shown, { name });
  $("happened").replaceChildren(...recording.happened.slice(-40).map((one) => element("li", { text: `${one.t.toFixed(3)} s: ${one.text}` })));
  $("player").hidden = false;
  goTo(0);
  $("tools").scrollIntoView();
}

function goTo(t) {
  const state = page.recording.states.findLast((one) => one.t <= t)?.state;
  $("at").value = t;
  $("at-says").textContent = fill(STRINGS.player_at, { s: Number(t).toFixed(2), state: state ?? STRINGS.unknown });
  for (const plot of allPlots()) {
    plot.draw();
    plot.uplot.setCursor({ left: plot.uplot.valToPos(t, "x"), top: 0 });
  }
}

function playOn() {
  const playing = $("play").dataset.on === "yes";
  $("play").dataset.on = playing ? "" : "yes";
  $("play").textContent = playing ? STRINGS.play : STRINGS.pause;
  let before = performance.now();
  const step = (now) => {
    if ($("play").dataset.on !== "yes" || !page.recording) return;
    const t = Number($("at").value) + (now - before) / 1000;
    before = now;
    goTo(Math.min(t, page.recording.last));
    if (t < page.recording.last) requestAnimationFrame(step);
    else playOn();
  };
  if (!playing) requestAnimationFrame(step);
}

function goLive() {
  page.recording = null;
  page.frozen = false;
  $("player").hidden = true;
  $("play").dataset.on = "";
  $("source").textContent = STRINGS.source_live;
  $("freeze").setAttribute("aria-pressed", "false");
  $("freeze").textContent = STRINGS.freeze;
  for (const plot of allPlots()) {
    plot.freeze(false);
    plot.show(null);
  }
}

function freeze() {
  page.frozen = !page.frozen;
  $("freeze").setAttribute("aria-pressed", String(page.frozen));
  $("freeze").textContent = page.frozen ? STRINGS.unfreeze : STRINGS.freeze;
  $("source").textContent = page.frozen ? fill(STRINGS.source_frozen, { when: new Date().toLocaleTimeString() }) : STRINGS.source_live;
  for (const plot of allPlots()) plot.freeze(page.frozen);
}
