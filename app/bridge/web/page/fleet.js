// SPDX-License-Identifier: MIT
"use strict";
// The page of a fleet. It reads the newest output of iwheel-fleet periodically, and sends nothing else.

const $ = (id) => document.getElementById(id);
const EVERY_MS = 2000, OLD_MS = 10000;

// Texts come from the machines: the page inserts them as text only, never as HTML.
function cell(label, text, kind = "") {
  const made = document.createElement("td");
  made.dataset.label = STRINGS[label];
  made.className = text === null ? "unknown" : kind;
  made.textContent = text ?? STRINGS.unknown;
  return made;
}

function pair(left, right, digits) {
  const words = [left, right].map((value) => (value === null ? STRINGS.unknown : digits === undefined ? value : `${(value / 10).toFixed(digits)} V`));
  return left === null && right === null ? null : words.join(" / ");
}

function row(machine) {
  const made = document.createElement("tr"), name = document.createElement("th"), online = machine.online;
  name.scope = "row";
  if (pages.address) {
    const link = document.createElement("a");
    link.href = pages.address.replaceAll("{machine}", encodeURIComponent(machine.machine));
    link.textContent = machine.machine;
    name.append(link);
  } else name.textContent = machine.machine;
  const stop = machine.cause === null ? STRINGS.fleet_never : `${when(machine.stop_wall_us)}: ${machine.cause}${machine.sentence ? `. ${machine.sentence}` : ""}`;
  made.append(name, cell("fleet_state", online ? STRINGS.states[machine.state] ?? machine.state : STRINGS.fleet_offline, online ? { latched: "bad", stopping: "care" }[machine.state] ?? "" : "care"),
    cell("fleet_last", stop, machine.cause === null ? "quiet" : ""),
    cell("fleet_battery", online ? pair(machine.left_battery_dV, machine.right_battery_dV, 1) : null),
    cell("fleet_zero", pair(machine.left_zero, machine.right_zero), [machine.left_zero, machine.right_zero].includes("doubted") ? "care" : ""),
    cell("fleet_version", machine.version));
  return made;
}

function contradictions(machines) {
  const counts = new Map();
  for (const machine of machines) for (const item of machine.contradicted.split(" ").filter(Boolean)) counts.set(item, (counts.get(item) ?? 0) + 1);
  return [...counts].map(([item, count]) => say("fleet_contradicted_on", { item, count, all: machines.length })).join("; ");
}

function showNews(text, kind) {
  $("news").textContent = text;
  $("news").className = kind;
}

// `now_ms` is the clock of the machine that wrote it, not of this one.
function show(fleet, now_ms) {
  const machines = fleet.machines, wrong = contradictions(machines), old = now_ms - fleet.wall_us / 1000 > OLD_MS;
  $("count").textContent = machines.length;
  $("online").textContent = machines.filter((machine) => machine.online).length;
  $("latched").textContent = machines.filter((machine) => machine.online && machine.state === "latched").map((machine) => machine.machine).join(", ") || STRINGS.fleet_nothing;
  $("contradicted").textContent = wrong || STRINGS.fleet_nothing;
  $("contradicted").className = wrong ? "care" : "";
  $("machines").replaceChildren(...machines.map(row));
  showNews(say(old ? "fleet_stale" : "fleet_fresh", { time: when(fleet.wall_us) }), old ? "bad" : "good");
}

// Address of each machine's own page, if that is configured.
const pages = { address: null };

async function findPages() {
  const answer = await askProved("GET", "/health");
  if (answer.status !== 401) pages.address = (await answer.json()).machine_page;
}

async function poll() {
  try {
    if (pages.address === null) await findPages();
    const answer = await askProved("GET", "/api/fleet");
    $("login").hidden = answer.status !== 401;
    $("main").hidden = answer.status === 401;
    const body = await answer.json();
    if (!answer.ok) throw new Error(body.message);
    show(body, Date.parse(answer.headers.get("Date")));
  } catch (error) {
    showNews(say("fleet_away", { why: error.message }), "bad");
  }
}

takeToken();
$("login").addEventListener("submit", (event) => {
  event.preventDefault();
  setToken($("token").value.trim());
  poll();
});
poll();
setInterval(() => document.hidden || poll(), EVERY_MS);
