// SPDX-License-Identifier: MIT
"use strict";
// The page: one stream of events from the bridge, what is known of it on the screen, and the stops.

const $ = (id) => document.getElementById(id);
const STALE_MS = 1000, STOP_TRY_MS = 400, DRIVE_MS = 100, ASK_MS = 1000;
const page = { state: null, heard: 0, gateway: null, stream: null, wait: 500, rights: {}, t_us: 0, frozen: false, recording: null, stop: null, delivered: null };

// ---- asking the bridge --------------------------------------------------------------------------------------------

async function ask(method, path, options) {
  const answer = await askProved(method, path, options);
  if (answer.status === 401) askToken();
  return answer;
}

// STOP needs no proof, and waits for none.
function askStop(options) {
  return fetch("/api/stop", { method: "POST", cache: "no-store", credentials: "omit", ...options });
}

async function askJson(path) {
  const answer = await ask("GET", path);
  const body = await answer.json();
  if (!answer.ok) throw new Error(body.message ?? answer.status);
  return body;
}

function askToken() {
  $("login").hidden = false;
  $("main").hidden = true;
  page.stream?.abort();
}

// Asks once, in words, before something that cannot be taken back.
// Not modal: a modal dialog would make STOP inert. STOP answers it with no.
function confirmed(text, yes) {
  const dialog = $("ask"), before = document.activeElement;
  dialog.onclose?.(); // Another question takes its place.
  $("ask-says").textContent = text;
  $("ask-yes").textContent = yes;
  if (!dialog.open) dialog.show();
  $("ask-no").focus();
  return new Promise((done) => {
    $("ask-yes").onclick = () => { done(true); dialog.close(); };
    $("ask-no").onclick = () => dialog.close();
    dialog.onclose = () => { done(false); dialog.onclose = null; before?.focus(); };
  });
}

// ---- the stream ---------------------------------------------------------------------------------------------------

async function listen() {
  if (page.stream || !proof.token || document.hidden) return;
  const control = new AbortController();
  page.stream = control;
  try {
    const health = await ask("GET", "/health", { signal: control.signal });
    if (health.status === 401) return;
    page.rights = await health.json();
    page.gateway = page.rights.gateway === "connected";
    $("to-fleet").hidden = !page.rights.fleet;
    const answer = await ask("GET", "/api/events", { signal: control.signal });
    if (!answer.ok) throw new Error(answer.status);
    $("login").hidden = true;
    $("main").hidden = false;
    page.wait = 500;
    showRights();
    loadStops();
    loadRecordings();
    await readEvents(answer.body.getReader());
  } catch (error) {
    page.gateway = null;
  } finally {
    if (page.stream === control) page.stream = null;
    page.state = null;
    page.wait = Math.min(page.wait * 1.5, 4000);
    setTimeout(listen, page.wait * (0.5 + Math.random() / 2));
  }
}

async function readEvents(reader) {
  const decoder = new TextDecoder();
  let rest = "";
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return;
    rest += decoder.decode(value, { stream: true });
    const blocks = rest.split("\n\n");
    rest = blocks.pop();
    for (const block of blocks) {
      const data = /^data: (.*)$/m.exec(block);
      if (data) takeEvent(JSON.parse(data[1]));
    }
  }
}

function takeEvent(event) {
  if (event.event === "state") takeState(event);
  else if (event.event === "gateway") {
    page.gateway = event.connected;
    if (!event.connected) page.state = null;
    if (!event.connected) letGo("why_slow");
    else loadRecordings();
  } else if (event.event === "stops") {
    loadStops();
    loadRecordings();
  }
}

function takeState(state) {
  page.state = state;
  forgetDelivered(state);
  page.t_us = state.t_us;
  page.heard = performance.now();
  page.gateway = true;
  const t = state.t_us / 1e6;
  for (const side of ["left", "right"]) {
    const wheel = state[side], newton = (mN) => (mN === null ? null : mN / 1000);
    plots[side].speed.add([t, wheel.commanded_mm_s, wheel.applied_mm_s, wheel.speed_mm_s]);
    plots[side].force.add([t, newton(wheel.force_raw_mN), newton(wheel.force_offset_mN), newton(wheel.force_net_mN)]);
  }
  const pose = state.pose;
  if (pose.x_mm !== null && pose.y_mm !== null) path.add(pose.x_mm, pose.y_mm, pose.psi_mrad);
}

// ---- what is known, in words --------------------------------------------------------------------------------------

function cureOf(state, cause) {
  const heard = state.left.heard && state.right.heard;
  if (cause === "send_stalled" && heard && !state.bus.name.startsWith("unix:")) return fill(STRINGS.next.echo, { bus: state.bus.name });
  return STRINGS.cures[cause] ?? null;
}

function presentAdvice(state) {
  return state.present.filter((cause) => cause !== state.cause).map((cause) => `${cause}: ${cureOf(state, cause) ?? STRINGS.next.see}`);
}

// The same lines as `iwheelctl status`.
function advise(state) {
  const next = STRINGS.next, cure = state.cause ? cureOf(state, state.cause) : null;
  if (state.state === "armed") return [next.armed];
  if (state.state === "stopping" && state.holding) return [next.holding];
  if (state.state === "stopping") return [cure ?? next.stopping];
  if (state.state === "latched") return [fill(next.latched, { cure: cure ?? next.remove }), ...presentAdvice(state)].slice(0, 6);
  if (state.state !== "listening") return [next.newer];
  const lines = presentAdvice(state);
  if (state.listen_only) return [...lines, next.listen_only].slice(0, 6);
  for (const item of ["setpoint_type", "current_role", "track"]) if (state.ledger[item]?.evidence === "none" && !state.ledger[item].value) lines.push(next[item]);
  for (const [item, entry] of Object.entries(state.ledger)) {
    if (entry.disabled?.startsWith("arm is refused; ")) lines.push(fill(next.contradicted, { item, cost: entry.disabled.slice(16) }));
  }
  return (lines.length ? lines : [next.ready]).slice(0, 6);
}

function text(id, value, tone = "") {
  const place = $(id), words = value ?? STRINGS.unknown;
  if (place.textContent !== words) place.textContent = words;
  place.classList.toggle("unknown", value === null || value === undefined);
  for (const one of ["good", "care", "bad"]) place.classList.toggle(one, one === tone);
}

function list(id, lines) {
  const words = lines.join("\n");
  if ($(id).dataset.words === words) return;
  $(id).dataset.words = words;
  $(id).replaceChildren(...lines.map((line) => element("li", { text: line })));
}

function decimal(value, digits, unit) {
  return value === null || value === undefined ? null : `${(value / 10 ** digits).toFixed(digits)} ${unit}`;
}

function number(value, unit) {
  return decimal(value, 0, unit);
}

const figures = [
  ["heard", (w) => (w.heard ? (w.at_rest ? STRINGS.at_rest : STRINGS.turning) : STRINGS.not_heard)],
  ["measured", (w) => number(w.speed_mm_s, "mm/s")],
  ["wanted", (w) => number(w.commanded_mm_s, "mm/s")],
  ["told", (w) => number(w.applied_mm_s, "mm/s")],
  ["current", (w) => number(w.applied_mA, "mA")],
  ["net", (w) => decimal(w.force_net_mN, 3, "N")],
  ["offset", (w) => decimal(w.force_offset_mN, 3, "N")],
  ["raw", (w) => decimal(w.force_raw_mN, 3, "N")],
  ["validity", (w) => w.force_validity],
  ["provenance", (w) => `${w.offset_provenance}${w.offset_provenance === "stored" && w.offset_origin ? ` (${w.offset_origin})` : ""}${w.offset_contaminated ? " IN DOUBT" : ""}`],
  ["battery", (w) => { const volts = decimal(w.battery_dV, 1, "V"); return volts && w.saturated.battery ? `>= ${volts}` : volts; }],
  ["temperature", (w) => number(w.temperature_degC, "°C")],
  ["distance", (w) => decimal(w.distance_mm, 3, "m")],
  ["ticks", (w) => number(w.ticks, "ticks")],
];

function showWheel(side, wheel) {
  for (const [name, read] of figures) text(`${side}-${name}`, wheel ? read(wheel) : null, name === "heard" && wheel && !wheel.heard ? "bad" : "");
}

// Of a real button: when it was last seen to work.
function tried(estop) {
  if (estop.simulated || estop.state === "none") return "";
  return fill(STRINGS.tried_says, { when: estop.tried_wall_us ? new Date(estop.tried_wall_us / 1000).toLocaleString() : STRINGS.never });
}

function showState(state) {
  const known = state.arming ? STRINGS.state_arming : STRINGS.states[state.state] ?? state.state;
  const word = state.holding ? fill(STRINGS.state_holding, { state: known }) : known;
  text("state", state.cause ? `${word} (${state.cause})` : word, state.state === "latched" ? "bad" : state.state === "listening" ? "" : "care");
  list("advice", advise(state));
  const { estop, bus, lease, budget } = state;
  text("estop", fill(STRINGS.estop_says, { state: estop.state === "none" ? "NONE" : estop.state, simulated: estop.simulated ? STRINGS.simulated : "", line: estop.line, second: estop.line2 === undefined ? "" : fill(STRINGS.second_says, estop), tried: tried(estop) }), estop.state === "released" ? "good" : "bad");
  text("bus", fill(STRINGS.bus_says, bus), bus.state === "active" ? "good" : "bad");
  text("lease", lease.holder === null ? fill(STRINGS.lease_none, { whole: lease.lease_ms })
    : fill(STRINGS.lease_says, { ...lease, name: lease.name ?? STRINGS.unknown, left: lease.remaining_ms, whole: lease.lease_ms }), lease.holder === null ? "" : "care");
  text("budget", fill(STRINGS.budget_says, { a: budget.client_lost_ms, b: (budget.client_lost_mm / 1000).toFixed(3), c: budget.killed_ms, d: (budget.killed_mm / 1000).toFixed(3) }));
  list("warnings", state.warnings);
  $("reset").hidden = !(page.rights.may_reset && state.state === "latched");
}

function showPose(pose) {
  text("pose-says", pose ? fill(STRINGS.pose_says, { x: pose.x_mm, y: pose.y_mm, psi: pose.psi_mrad, limited: pose.limited ? STRINGS.pose_limited : "" }) : null);
}

function showGaps(gaps) {
  text("gaps-says", gaps && gaps.worst_us !== null ? fill(STRINGS.gaps_says, { ms: (gaps.worst_us / 1000).toFixed(1) }) : null);
  if (!gaps || $("gaps").dataset.words === gaps.count.join()) return;
  $("gaps").dataset.words = gaps.count.join();
  const most = Math.max(...gaps.count, 1);
  const bars = element("div", { class: "bars" });
  gaps.count.forEach((count, i) => {
    const label = i < gaps.limits_ms.length ? fill(STRINGS.gap_below, { ms: gaps.limits_ms[i] }) : fill(STRINGS.gap_above, { ms: gaps.limits_ms.at(-1) });
    const bar = element("i");
    bar.style.width = `${(100 * count) / most}%`;
    bar.hidden = count === 0;
    bars.append(element("span", { text: label }), element("span", {}, bar), element("span", { text: String(count) }));
  });
  $("gaps").replaceChildren(bars);
}

function rows(table, head, lines) {
  const words = JSON.stringify(lines);
  if (table.dataset.words === words) return;
  table.dataset.words = words;
  const body = lines.map((cells) => element("tr", {}, ...cells.map((cell, i) => element(i ? "td" : "th", i ? { text: cell ?? STRINGS.unknown } : { text: cell, scope: "row" }))));
  const top = head.length ? [element("thead", {}, element("tr", {}, ...head.map((cell) => element("th", { text: cell, scope: "col" }))))] : [];
  table.replaceChildren(...top, element("tbody", {}, ...body));
}

function showTables(state) {
  rows($("ledger"), STRINGS.ledger_head, Object.entries(state?.ledger ?? {}).map(([item, entry]) =>
    [item, entry.state, entry.value, entry.reason + (entry.disabled ? ` — ${fill(STRINGS.disabled, { what: entry.disabled })}` : "")]));
  rows($("counters"), [], Object.entries(state?.counters ?? {}).map(([name, value]) => [name, value === null ? null : String(value)]));
}

function showNews() {
  const silent = performance.now() - page.heard, known = page.state !== null;
  if (page.gateway === null || !page.stream) text("news", STRINGS.news_bridge, "bad");
  else if (!page.gateway) text("news", STRINGS.news_away, "bad");
  else if (!known || silent > STALE_MS) text("news", fill(STRINGS.news_none, { s: known ? (silent / 1000).toFixed(0) : "?" }), "bad");
  else text("news", STRINGS.news_live, "good");
  const stale = !known || silent > STALE_MS;
  document.body.classList.toggle("stale", stale);
  return stale;
}

function showUnknown() {
  for (const id of ["state", "estop", "bus", "lease", "budget"]) text(id, null);
  list("advice", []);
  list("warnings", []);
  showGaps(null);
}

function show() {
  const state = showNews() ? null : page.state;
  if (state) showState(state); else showUnknown();
  for (const side of ["left", "right"]) showWheel(side, state?.[side]);
  showPose(state?.pose);
  if (state) showGaps(state.gaps);
  showTables(state);
}

// ---- STOP ---------------------------------------------------------------------------------------------------------

// Repeated until the gateway answers. Says loudly, and goes on saying, that it did not. The second control takes the place of a stop that is
// not delivered yet, never the other way round.
async function deliver(name) {
  deliver.verb = deliver.busy && deliver.verb === "estop" ? "estop" : name;
  if (deliver.busy) return;
  deliver.busy = true;
  let times = 0, why = "";
  tell(STRINGS.stopping_now);
  for (;;) {
    times++;
    const asked = deliver.verb;
    try {
      const options = { signal: AbortSignal.timeout(STOP_TRY_MS), keepalive: true };
      const answer = await (asked === "stop" ? askStop(options) : ask("POST", "/api/estop", options));
      const body = await answer.json();
      if (answer.ok) {
        tell(fill(STRINGS.delivered, { state: STRINGS.states[body.state] ?? body.state }), "good");
        page.delivered = { state: body.state, seen: false, ms: performance.now() };
        if (asked === deliver.verb) break;
        continue;
      }
      why = body.message;
      if (answer.status === 401) { notDelivered(why, times); break; }
    } catch {
      why = STRINGS.no_answer;
    }
    notDelivered(why.replace(`${STRINGS.not_delivered}: `, ""), times);
    page.stream?.abort(); // It may hold the last connection that the browser allows.
    await new Promise((done) => setTimeout(done, STOP_TRY_MS / 2));
  }
  deliver.busy = false;
}

// What was said of a stop goes with the next state.
function forgetDelivered(state) {
  const said = page.delivered;
  if (!said) return;
  if (state.state === said.state) said.seen = true;
  else if (said.seen || performance.now() - said.ms > 1000) tell("");
}

function tell(words, tone = "") {
  page.delivered = null;
  $("delivered").className = tone;
  $("delivered").textContent = words;
}

// A zoom by two fingers moves what is fixed off the screen: the bar goes along, at its size.
function keepStopInSight() {
  const seen = visualViewport, bar = $("bar");
  bar.style.transform = "";
  const place = bar.getBoundingClientRect(), factor = seen.width / place.width;
  if (factor > 0.99) return;
  bar.style.transform = `translate(${seen.offsetLeft - place.left}px, ${seen.offsetTop + seen.height - place.bottom}px) scale(${factor})`;
}

async function reset(stop) {
  try {
    const query = new URLSearchParams({ boot: await bootOf(), t_us: page.t_us, stop });
    const body = await (await ask("POST", `/api/reset?${query}`, { signal: AbortSignal.timeout(ASK_MS) })).json();
    tell(body.ok ? "" : fill(STRINGS.refused, { why: body.message }));
  } catch {
    tell(fill(STRINGS.refused, { why: STRINGS.no_answer }));
  }
}

function notDelivered(why, times) {
  tell(STRINGS.not_delivered, "bad");
  $("delivered").append(element("small", { text: fill(STRINGS.not_delivered_why, { why, times }) }));
}

// ---- driving: only while somebody holds the pad -----------------------------------------------------------------------

// No release comes from a mouse or keyboard whose link died: each report of it is evidence of a hand, and driving needs a fresh one.
const HAND_WARN_MS = 1000, HAND_STOP_MS = 2000;
const drive = { on: false, held: false, key: "", sequence: 0, v: 0, yaw: 0, session: 0, hand_ms: 0 };

function padSays(words) {
  $("pad-says").textContent = words;
}

function showRights() {
  $("drive").hidden = !page.rights.may_drive;
}

function aim(x, y) {
  const clamp = (value) => Math.max(-1, Math.min(1, value));
  drive.v = Math.round(-clamp(y) * page.rights.max_speed_mm_s);
  drive.yaw = Math.round(-clamp(x) * 800);
  $("knob").style.left = `${50 + clamp(x) * 50}%`;
  $("knob").style.top = `${50 + clamp(y) * 50}%`;
  $("knob").classList.toggle("moved", x !== 0 || y !== 0);
}

function hand() {
  drive.hand_ms = performance.now();
}

async function hold(x, y) {
  if (!drive.on) return;
  hand();
  aim(x, y);
  if (drive.held) return;
  drive.held = true;
  $("pad").classList.add("held");
  const session = ++drive.session, since = page.t_us; // Since when the hand is there, by the machine's own clock.
  try {
    const query = new URLSearchParams({ boot: await bootOf(), t_us: since });
    const answer = await ask("POST", `/api/arm?${query}`, { signal: AbortSignal.timeout(ASK_MS) });
    const body = await answer.json();
    if (!answer.ok) throw new Error(body.message);
    if (!drive.held || session !== drive.session) return void deliver("stop");
    drive.key = body.key;
    drive.sequence = 0;
    await feed(session);
  } catch (error) {
    if (session === drive.session) release(error.message);
  }
}

// One command at a time, each quoting the newest time heard: what is late is dropped by the bridge, never carried out.
async function feed(session) {
  while (drive.held && session === drive.session) {
    const begun = performance.now(), still_ms = begun - drive.hand_ms;
    if (still_ms > HAND_STOP_MS) return void letGo("why_no_hand");
    const query = new URLSearchParams({ key: drive.key, sequence: ++drive.sequence, t_us: page.t_us, v_mm_s: drive.v, yaw_mrad_s: drive.yaw });
    const answer = await ask("POST", `/api/drive?${query}`, { signal: AbortSignal.timeout(page.rights.ttl_ms) });
    if (!answer.ok) throw new Error((await answer.json()).message);
    padSays(fill(still_ms > HAND_WARN_MS ? STRINGS.pad_no_hand : STRINGS.pad_drives, { v: drive.v, yaw: drive.yaw }));
    await new Promise((done) => setTimeout(done, Math.max(0, DRIVE_MS - (performance.now() - begun))));
  }
}

function release(why) {
  if (!drive.held) return;
  drive.held = false;
  drive.session++;
  $("pad").classList.remove("held");
  aim(0, 0);
  padSays(fill(STRINGS.pad_stopped, { why }));
  deliver("stop");
}

function letGo(name) {
  release(STRINGS[name]);
}

function setUpDriving() {
  const pad = $("pad"), keys = { ArrowUp: [0, -0.6], ArrowDown: [0, 0.6], ArrowLeft: [-0.6, 0], ArrowRight: [0.6, 0] };
  const from = (event) => {
    const box = pad.getBoundingClientRect();
    return [((event.clientX - box.left) / box.width) * 2 - 1, ((event.clientY - box.top) / box.height) * 2 - 1];
  };
  pad.setAttribute("aria-label", STRINGS.pad);
  pad.addEventListener("pointerdown", (event) => { pad.setPointerCapture(event.pointerId); pad.focus(); hold(...from(event)); });
  pad.addEventListener("pointermove", (event) => { if (drive.held) { hand(); aim(...from(event)); } });
  for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) pad.addEventListener(name, () => letGo("why_let_go"));
  pad.addEventListener("keydown", (event) => { if (keys[event.key]) { event.preventDefault(); hand(); if (!event.repeat) hold(...keys[event.key]); } });
  pad.addEventListener("keyup", (event) => { if (keys[event.key]) letGo("why_let_go"); });
  pad.addEventListener("blur", () => letGo("why_hidden"));
  pad.addEventListener("contextmenu", (event) => event.preventDefault());
  $("arm").addEventListener("click", async () => {
    if (!(await confirmed(STRINGS.ask_arm, STRINGS.ask_arm_yes))) return;
    drive.on = true;
    $("arm").hidden = true;
    pad.hidden = false;
    padSays(STRINGS.pad_ready);
  });
}

// ---- stops and recordings -----------------------------------------------------------------------------------------

const when = (wall_us) => (wall_us === null ? STRINGS.unknown : new Date(wall_us / 1000).toLocaleString());

async function loadStops() {
  let stops;
  try {
    ({ stops } = await askJson("/api/stops"));
  } catch {
    return;
  }
  const newest = stops[0];
  page.stop = newest?.number ?? null;
  $("last-stop").textContent = newest ? fill(STRINGS.last_stop, newest) : "";
  const open = new Set([...document.querySelectorAll("#stops details[open]")].map((one) => one.dataset.number));
  $("stops").replaceChildren(...(stops.length ? stops.map((stop) => showStop(stop, open.has(String(stop.number)))) : [element("p", { text: STRINGS.no_stops, class: "quiet" })]));
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

// ---- setting up ---------------------------------------------------------------------------------------------------

const plots = {};
let path;

function allPlots() {
  return Object.values(plots).flatMap((pair) => Object.values(pair));
}

function setUpWheel(side) {
  const card = $(side), label = (name) => fill(STRINGS[name], { side: STRINGS[side] });
  plots[side] = {
    speed: new Plot(card, STRINGS.speed_plot, label("speed_label"), [
      { name: "wanted", label: STRINGS.wanted, column: "wanted_mm_s", dash: [2, 4] }, { name: "told", label: STRINGS.told, column: "told_mm_s", dash: [8, 4] },
      { name: "measured", label: STRINGS.measured, column: "measured_mm_s" }], `${side}-speed`),
    force: new Plot(card, STRINGS.force_plot, label("force_label"), [
      { name: "wanted", label: STRINGS.raw, column: "raw_N", dash: [2, 4] }, { name: "offset", label: STRINGS.offset, column: "offset_N", dash: [8, 4] },
      { name: "measured", label: STRINGS.net, column: "net_N" }], `${side}-force`),
  };
  card.append(element("dl", { class: "facts" }, ...figures.map(([name]) =>
    element("div", {}, element("dt", { text: STRINGS[name] }), element("dd", { id: `${side}-${name}` })))));
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
  const press = () => { release(STRINGS.why_let_go); deliver("stop"); $("ask").close(); };
  $("stop").addEventListener("pointerdown", press); // When it is touched, not when the finger leaves it.
  $("stop").addEventListener("click", (event) => { if (event.detail === 0) press(); }); // By Enter, or by a screen reader.
  $("estop-ask").addEventListener("click", async () => { if (await confirmed(STRINGS.ask_estop, STRINGS.ask_estop_yes)) deliver("estop"); });
  $("reset").addEventListener("click", async () => {
    const stop = page.stop; // The one that the person sees: a later one is not cleared.
    if (await confirmed(STRINGS.ask_reset, STRINGS.ask_reset_yes)) reset(stop);
  });
  document.addEventListener("keydown", (event) => {
    const typing = event.target.matches("input") && event.target.type !== "range";
    if (event.key.toLowerCase() === "s" && !typing && !event.ctrlKey && !event.metaKey && !event.altKey && !event.repeat) press();
    if (event.key === "Escape") $("ask").close();
  });
  visualViewport.addEventListener("resize", keepStopInSight);
  visualViewport.addEventListener("scroll", keepStopInSight);
  $("freeze").addEventListener("click", freeze);
  $("live").addEventListener("click", goLive);
  $("play").addEventListener("click", playOn);
  $("at").addEventListener("input", () => goTo(Number($("at").value)));
  $("pose-clear").addEventListener("click", () => path.clear());
  $("files").addEventListener("change", (event) => openFiles(event.target.files));
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
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { allPlots().forEach((plot) => plot.build()); path.dirty = true; });
  if (!proof.token) askToken();
  listen();
  setInterval(show, 200);
  const paint = () => {
    if (performance.now() - paint.last >= 50) {
      paint.last = performance.now();
      allPlots().forEach((plot) => plot.draw());
      path.draw();
    }
    requestAnimationFrame(paint);
  };
  paint.last = 0;
  requestAnimationFrame(paint);
}

setUp();
