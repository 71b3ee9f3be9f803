// SPDX-License-Identifier: MIT
"use strict";
// Shows the state of the machine in words and figures.

function fixOf(state, cause) {
  const online = state.left.heard && state.right.heard;
  if (cause === "send_stalled" && online && !state.bus.name.startsWith("unix:")) return fill(STRINGS.next.echo, { bus: state.bus.name });
  return STRINGS.fixes[cause] ?? null;
}

function presentAdvice(state) {
  return state.present.filter((cause) => cause !== state.cause).map((cause) => `${cause}: ${fixOf(state, cause) ?? STRINGS.next.see}`);
}

// The same lines as `iwheelctl status`.
function advise(state) {
  return [...(state.rolling ? [STRINGS.next.rolling] : []), ...adviseIn(state)].slice(0, 6);
}

const turns = (wheel) => wheel.heard && !wheel.at_rest;

function adviseIn(state) {
  const next = STRINGS.next, fix = state.cause ? fixOf(state, state.cause) : null;
  if (state.state === "armed") return [next.armed];
  if (state.state === "stopping" && state.holding) return [next.holding];
  if (state.state === "stopping") return [fill(next.stopping, { fix: fix ?? next.standstill })];
  if (state.state === "latched") return [fill(next.latched, { fix: fix ?? next.remove }), ...presentAdvice(state)];
  if (state.state !== "listening") return [next.newer];
  const lines = presentAdvice(state);
  if (state.listen_only) return [...lines, next.listen_only];
  for (const item of ["setpoint_type", "current_role", "track"]) if (state.ledger[item]?.evidence === "none" && !state.ledger[item].value) lines.push(next[item]);
  for (const [item, entry] of Object.entries(state.ledger)) {
    if (entry.disabled?.startsWith("arm is refused; ")) lines.push(fill(next.contradicted, { item, cost: entry.disabled.slice(16) }));
  }
  if (!lines.length && !state.rolling) lines.push(turns(state.left) || turns(state.right) ? next.turning : next.ready);
  return lines;
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
  ["telemetry", (w) => (w.heard ? (w.at_rest ? STRINGS.at_rest : STRINGS.turning) : STRINGS.not_heard)],
  ["measured", (w) => number(w.speed_mm_s, "mm/s")],
  ["wanted", (w) => number(w.commanded_mm_s, "mm/s")],
  ["applied", (w) => number(w.applied_mm_s, "mm/s")],
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
  for (const [name, read] of figures) text(`${side}-${name}`, wheel ? read(wheel) : null, name === "telemetry" && wheel && !wheel.heard ? "bad" : "");
}

const toneOf = (state) => ({ latched: "bad", stopping: "care", stopped: "bad", died: "bad" })[state] ?? "accent";

const capital = (words) => words.charAt(0).toUpperCase() + words.slice(1);

// The state in one word, its tone, and one sentence with the next action.
function inOneWord(state) {
  const { word, here, next } = STRINGS, lines = advise(state), first = lines[0];
  if (state.rolling) return [word.rolling, "bad", next.rolling];
  if (state.state === "latched") {
    const fix = fixOf(state, state.cause) ?? next.remove;
    return [word.latched, "bad", fill(page.rights.may_reset ? here.latched : next.latched, { fix })];
  }
  if (state.arming) return [word.arming, "busy", next.armed];
  if (state.state === "armed") return [word.armed, "busy", drive.held ? here.armed_here : fill(here.armed, { name: state.lease.name })];
  if (state.state === "stopping") return [state.holding ? word.holding : word.stopping, "care", first];
  if (first === next.ready) return [word.ready, "good", page.rights.may_drive ? here.ready_drive : here.ready];
  const [present] = state.present;
  if (present) return [word.not_ready, "care", `${causeInWords({ cause: present })}: ${fixOf(state, present) ?? next.see}`];
  return state.listen_only && first === next.listen_only ? [word.watching, "care", first] : [word.not_ready, "care", first];
}

const UNITS = { "m/s": (mm_s) => (mm_s / 1000).toFixed(2), "km/h": (mm_s) => (mm_s * 0.0036).toFixed(1) };
let unit = Object.hasOwn(UNITS, storage.read("units")) ? storage.read("units") : "m/s";

// No sign before a zero.
const plain = (words) => words.replace(/^-(0(\.0*)?)$/, "$1");

function speed(mm_s) {
  return mm_s === null || mm_s === undefined ? null : plain(UNITS[unit](mm_s));
}

// The figures for reading from two metres away: their units are in the first column.
function showFigures(state) {
  $("big-unit").textContent = unit;
  for (const side of ["left", "right"]) {
    const wheel = state?.[side], volts = wheel && decimal(wheel.battery_dV, 1, "");
    text(`big-${side}-speed`, speed(wheel?.speed_mm_s) ?? "–");
    text(`big-${side}-force`, wheel?.force_net_mN === null || !wheel ? "–" : plain((wheel.force_net_mN / 1000).toFixed(1)));
    text(`big-${side}-battery`, volts ? `${wheel.saturated.battery ? "≥ " : ""}${volts.trim()}` : "–");
  }
  const estop = state?.estop, known = estop ? STRINGS.estop_words[estop.state] ?? estop.state : null;
  for (const id of ["big-estop", "pad-estop"]) text(id, known, estop ? (estop.state === "released" ? "good" : "bad") : "");
  $("big-simulated").textContent = estop?.simulated ? STRINGS.estop_simulated : "";
}

function showNow(state) {
  const [word, tone, sentence] = state ? inOneWord(state) : [STRINGS.word.unknown, "bad", $("news").textContent];
  $("now").dataset.tone = tone;
  for (const id of ["word", "pad-word"]) text(id, word);
  text("sentence", capital(sentence).replace(/[.!?]?$/, "."));
  const many = state?.warnings.length ?? 0;
  text("more-says", many ? fill(STRINGS.more_warnings, { n: many }) : STRINGS.more);
  $("more-says").classList.toggle("care", many > 0);
}

// With a real button: the last time at which it worked.
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
  const silent = performance.now() - page.received_ms, known = page.state !== null;
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
  $("reset").hidden = true;
  list("advice", []);
  list("warnings", []);
  showGaps(null);
}

function show() {
  const state = showNews() ? null : page.state;
  showNow(state);
  showFigures(state);
  showMotion(state);
  if (state) showState(state); else showUnknown();
  for (const side of ["left", "right"]) showWheel(side, state?.[side]);
  showPose(state?.pose);
  if (state) showGaps(state.gaps);
  showTables(state);
}
