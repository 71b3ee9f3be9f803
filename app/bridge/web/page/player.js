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
  $("recordings").replaceChildren(...[...found].reverse().map(recordingCard));
}

// What it is, when it was made, and a button for each thing that can be done with it.
function recordingCard(one) {
  const there = ["log", "jsonl", "conf"].filter((ending) => one[`${ending}_bytes`] !== null);
  const button = (text, label, action, kind = "") => {
    const made = element("button", { type: "button", text, "aria-label": label, ...(kind ? { "data-ending": kind } : {}) });
    made.addEventListener("click", action);
    return made;
  };
  const saved = (name) => fill(STRINGS.recording_save_of, { name });
  const saves = there.map((ending) => {
    const name = `${one.name}.${ending}`;
    const text = ending === "log" ? STRINGS.log_recording : `.${ending}`;
    return button(text, `${text}: ${saved(name)}`, async () => { const blob = await load(name); if (blob) save(blob, name); }, ending);
  });
  const csv = button(STRINGS.csv_recording, saved(`${one.name}.csv`), async () => {
    const recording = decodeRecording(await loadAll(one.name, there));
    if (recording) save(new Blob([recordingCsv(recording)], { type: "text/csv" }), `${one.name}.csv`);
  }, "csv");
  const size = one.log_bytes === null ? STRINGS.unknown : `${(one.log_bytes / 1000).toFixed(0)} kB`, cause = STRINGS.recording_causes[one.cause] ?? causeInWords({ cause: one.cause });
  return element("li", {}, element("h3", { text: capital(cause) }), element("p", { class: "quiet", text: fill(STRINGS.recording_facts, { when: when(one.wall_us), size, name: one.name }) }),
    element("div", { class: "row" }, button(STRINGS.recording_open, fill(STRINGS.recording_open_of, one), () => openRecording(one.name, there)), ...saves, csv));
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

// Its files as texts; what cannot be read is left out, and said.
async function loadAll(name, endings) {
  const files = {};
  for (const ending of endings) {
    const blob = await load(`${name}.${ending}`);
    if (blob) files[ending] = await blob.text();
  }
  return files;
}

async function openRecording(name, endings) {
  const files = await loadAll(name, endings);
  if (endings.every((ending) => ending in files)) showRecording(name, files);
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
  view.marks = recording.happened.map(({ t, state, cause }) => ({ t, words: cause ? causeInWords({ cause }) : STRINGS.states[state] ?? state, tone: toneOf(state) }));
  Object.assign($("at"), { min: recording.first, max: recording.last, value: 0 });
  $("source").textContent = fill(STRINGS.recording_shown, { name });
  $("happened").replaceChildren(...recording.happened.slice(-40).map((one) => element("li", { text: `${one.t.toFixed(3)} s: ${one.text}` })));
  $("player").hidden = false;
  document.body.classList.add("recorded"); // The figures of now are not shown under its headings.
  goTo(0);
  $("tools").scrollIntoView();
}

function goTo(t) {
  const state = page.recording.states.findLast((one) => one.t <= t)?.state;
  $("at").value = t;
  view.at = Number(t);
  $("at-says").textContent = fill(STRINGS.player_at, { s: Number(t).toFixed(2), state: state ?? STRINGS.unknown });
  for (const plot of view.plots) plot.showAt();
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
  view.at = view.marks = null;
  document.body.classList.remove("recorded");
  $("player").hidden = true;
  $("play").dataset.on = "";
  $("source").textContent = STRINGS.source_live;
  $("freeze").setAttribute("aria-pressed", "false");
  $("freeze").textContent = STRINGS.freeze;
  freezeView(false);
  for (const plot of view.plots) plot.show(null);
}

// How much of the time up to now is shown.
function showSpan(seconds) {
  view.span_s = seconds;
  for (const one of $("spans").children) one.setAttribute("aria-pressed", String(Number(one.dataset.seconds) === seconds));
  resetView();
}

function showAllForces() {
  const all = $("forces").getAttribute("aria-pressed") !== "true";
  $("forces").setAttribute("aria-pressed", String(all));
  for (const side of ["left", "right"]) plots[side].force.showAll(all);
}

function freeze() {
  page.frozen = !page.frozen;
  $("freeze").setAttribute("aria-pressed", String(page.frozen));
  $("freeze").textContent = page.frozen ? STRINGS.unfreeze : STRINGS.freeze;
  $("source").textContent = page.frozen ? fill(STRINGS.source_frozen, { when: new Date().toLocaleTimeString() }) : STRINGS.source_live;
  freezeView(page.frozen);
}
