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
  const open = new Set([...document.querySelectorAll("#stops [aria-expanded='true']")].map((one) => one.dataset.number));
  $("stops").replaceChildren(...(stops.length ? stops.map((stop) => stopCard(stop, open.has(String(stop.number)))) : [element("li", { text: STRINGS.no_stops, class: "quiet" })]));
}

// "e-stop pressed", "wheel offline (left)": the list has the sentence with all figures.
function causeInWords({ cause, side }) {
  const words = STRINGS.causes[cause] ?? cause;
  return side ? `${words} (${STRINGS.sides[side] ?? side})` : words;
}

function button(text, label, action, more = {}) {
  const made = element("button", { type: "button", text, "aria-label": label, ...more });
  made.addEventListener("click", action);
  return made;
}

// Cause, time and sentence of a stop, its frames on request, and its recording in the plots.
function stopCard(stop, isOpen) {
  const frames = element("div", { class: "scroll", tabindex: "0", role: "group", "aria-label": STRINGS.frames_label, hidden: "" });
  const title = capital(causeInWords(stop)), name = stop.recording?.split("/").pop().replace(/\.log$/, "");
  const toggle = button(STRINGS.stop_frames, say("stop_frames_of", { what: title }), () => {
    if (!frames.children.length) frames.append(...stopFrames(stop));
    frames.hidden = !frames.hidden;
    toggle.setAttribute("aria-expanded", String(!frames.hidden));
  }, { "aria-expanded": "false", "data-number": stop.number });
  const opens = name ? [button(STRINGS.stop_open, say("stop_open_of", { name }), () => openRecording(name, ["log", "jsonl", "conf"]))] : [];
  if (isOpen) toggle.click();
  return element("li", {}, element("h3", { text: title }), element("p", { class: "quiet", text: when(stop.wall_us) }), element("p", { text: stop.sentence }),
    element("div", { class: "row" }, toggle, ...opens), frames);
}

function stopFrames(stop) {
  const [svg, frames] = drawFrames(stop), table = element("table");
  rows(table, [STRINGS.frame_time, STRINGS.frame_id, STRINGS.frame_data, STRINGS.frame_kind], frames.map((frame) => [frame.ms.toFixed(1), `${frame.id} ${IDS[frame.id] ?? ""}`, frame.data, frame.kind]));
  return [svg, table];
}

async function loadRecordings() {
  let found, running;
  try {
    ({ recordings: found, on_request: running } = await askJson("/api/recordings"));
  } catch (error) {
    $("recordings-says").textContent = fill(STRINGS.recordings_unknown, { why: error.message });
    return;
  }
  $("recordings-says").textContent = found.length ? "" : STRINGS.recordings_none;
  $("recordings").replaceChildren(...[...found].reverse().map(recordingCard));
  if (running) showRecord(running, found.find((one) => one.name === running.name)); // A gateway of an earlier version has none.
}

// The recording on request, on the gateway's disk.
function showRecord(running, file) {
  const { on, ended, fault, most_ms, most_bytes } = running, limits = { min: most_ms / 60000, MB: Math.floor(most_bytes / 1e6) };
  const ends = { time: say("record_time", limits), size: say("record_size", limits), fault: say("record_fault", { why: fault }) };
  const says = on ? say("record_runs", { ...limits, kB: file?.log_bytes ? Math.round(file.log_bytes / 1000) : 0 }) : ends[ended] ?? "";
  $("record").hidden = false;
  $("record").dataset.on = on ? "yes" : "";
  $("record").textContent = on ? STRINGS.record_end : STRINGS.record_begin;
  if ($("record-says").textContent !== says) $("record-says").textContent = says;
  $("record-says").className = on || ended === "fault" ? "care" : "quiet";
  clearTimeout(showRecord.timer);
  if (on) showRecord.timer = setTimeout(loadRecordings, 2000);
}

async function switchRecord() {
  try {
    const answer = await ask("POST", `/api/record?on=${$("record").dataset.on !== "yes"}`, { signal: AbortSignal.timeout(ASK_MS) });
    const body = await answer.json();
    if (!answer.ok) throw new Error(body.message);
    showRecord(body);
    showRecord.timer = setTimeout(loadRecordings, 500); // The files then exist, or are complete.
  } catch (error) {
    $("record-says").textContent = fill(STRINGS.refused, { why: error.message });
  }
}

// A recording: its cause, its time, and a button for each action.
function recordingCard(one) {
  const there = ["log", "jsonl", "conf"].filter((ending) => one[`${ending}_bytes`] !== null);
  const saved = (name) => fill(STRINGS.recording_save_of, { name });
  const saves = there.map((ending) => {
    const name = `${one.name}.${ending}`;
    const text = ending === "log" ? STRINGS.log_recording : `.${ending}`;
    return button(text, `${text}: ${saved(name)}`, () => doJob(async (report) => save(await load(name, report), name)), { "data-ending": ending });
  });
  const decoded = (ending, text, type, partsOf) => button(text, saved(`${one.name}.${ending}`), () => doJob(async (report) => {
    const recording = await decodeFiles(one.name, await loadAll(one.name, there, report), report), name = `${one.name}.${ending}`;
    save(new Blob(await inSteps(partsOf(recording), report("job_writing", name)), { type }), name);
  }), { "data-ending": ending });
  const decodes = [decoded("csv", STRINGS.csv_recording, "text/csv", recordingCsv), decoded("mcap", STRINGS.mcap_recording, "application/octet-stream", recordingMcap)];
  const size = one.log_bytes === null ? STRINGS.unknown : `${(one.log_bytes / 1000).toFixed(0)} kB`, cause = STRINGS.recording_causes[one.cause] ?? causeInWords({ cause: one.cause });
  return element("li", {}, element("h3", { text: capital(cause) }), element("p", { class: "quiet", text: fill(STRINGS.recording_facts, { when: when(one.wall_us), size, name: one.name }) }),
    element("div", { class: "row" }, button(STRINGS.recording_open, fill(STRINGS.recording_open_of, one), () => openRecording(one.name, there)), ...saves, ...decodes));
}

const CANCELLED = new Error(), job = { number: 0 };

// What takes long runs as the one job of the page, which shows its progress and can be cancelled. Another job replaces it.
// `report(words, name)` returns the function that its steps call with the part that is done.
async function doJob(work) {
  endJob();
  const number = job.number;
  const report = (words, name) => {
    const says = say(words, { name });
    return (share) => {
      if (number !== job.number) throw CANCELLED;
      $("job").hidden = false;
      if ($("job-says").textContent !== says) $("job-says").textContent = says;
      $("job-done").value = share;
    };
  };
  try {
    await work(report);
    if (number === job.number) endJob();
  } catch (error) {
    if (number === job.number) jobFailed(error.message);
  }
}

function jobFailed(why) {
  $("job").hidden = false;
  $("job-done").hidden = true;
  $("job-says").textContent = why;
  $("job-end").textContent = STRINGS.close;
}

function endJob() {
  job.number++;
  $("job").hidden = true;
  $("job-done").hidden = false;
  $("job-end").textContent = STRINGS.cancel;
}

function load(name, report) {
  return readRecording(askJson, name, report("recording_loading", name));
}

// Returns its files as texts.
async function loadAll(name, endings, report) {
  const files = {};
  for (const ending of endings) files[ending] = await (await load(`${name}.${ending}`, report)).text();
  return files;
}

async function decodeFiles(name, files, report) {
  const recording = await inSteps(decodeRecording(files), report("job_decoding", name));
  if (!recording) throw new Error(say("recording_bad", { name: name || STRINGS.unknown }));
  return recording;
}

function openRecording(name, endings) {
  doJob(async (report) => showRecording(name, await decodeFiles(name, await loadAll(name, endings, report), report)));
}

function openFiles(list) {
  doJob(async (report) => {
    const files = {};
    let name = "";
    for (const file of list) {
      const found = /^(.*)\.(log|jsonl|conf)$/.exec(file.name);
      if (found) [name, files[found[2]]] = [found[1], await file.text()];
    }
    showRecording(name, await decodeFiles(name, files, report));
  });
}

// Words of an event, as those of the live plots.
function eventInWords({ type, state, cause, side, refused }) {
  if (cause) return causeInWords({ cause, side });
  return STRINGS.states[state] ?? STRINGS.events[refused ? "refused" : type] ?? type;
}

function showRecording(name, recording) {
  if (!page.recording) page.forces_before = showsAllForces();
  page.recording = recording;
  showAllForces(true); // A recording has raw forces only.
  ["left", "right"].forEach((side, i) => {
    plots[side].speed.show(recording.wheels[i].speed);
    plots[side].force.show(recording.wheels[i].force);
  });
  view.marks = [];
  for (const one of recording.happened) addMark(view.marks, one.t, eventInWords(one), toneOf(one.state ?? one.type));
  Object.assign($("at"), { min: recording.first, max: recording.last, value: 0 });
  $("source").textContent = fill(STRINGS.recording_shown, { name });
  $("happened").replaceChildren(...recording.happened.slice(-40).map((one) => element("li", { text: `${one.t.toFixed(3)} s: ${eventInWords(one)}` })));
  $("player").hidden = false;
  document.body.classList.add("recorded"); // No live figure is shown under its headings.
  goTo(0);
  $("tools").scrollIntoView();
}

function goTo(t) {
  const state = page.recording.states.findLast((one) => one.t <= t)?.state;
  $("at").value = t;
  view.at = Number(t);
  $("at-says").textContent = fill(STRINGS.player_at, { s: Number(t).toFixed(2), state: STRINGS.states[state] ?? state });
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
  if (page.recording) showAllForces(page.forces_before);
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

// The shown time up to now.
function showSpan(seconds) {
  view.span_s = seconds;
  for (const one of $("spans").children) one.setAttribute("aria-pressed", String(Number(one.dataset.seconds) === seconds));
  resetView();
}

function showAllForces(all) {
  $("forces").setAttribute("aria-pressed", String(all));
  for (const side of ["left", "right"]) plots[side].force.showAll(all);
}

const showsAllForces = () => $("forces").getAttribute("aria-pressed") === "true";

function freeze() {
  page.frozen = !page.frozen;
  $("freeze").setAttribute("aria-pressed", String(page.frozen));
  $("freeze").textContent = page.frozen ? STRINGS.unfreeze : STRINGS.freeze;
  $("source").textContent = page.frozen ? fill(STRINGS.source_frozen, { when: new Date().toLocaleTimeString() }) : STRINGS.source_live;
  freezeView(page.frozen);
}
