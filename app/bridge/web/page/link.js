// SPDX-License-Identifier: MIT
"use strict";
// The bridge: requests to it, and the one stream of its events.

const STALE_MS = 1000, ASK_MS = 1000;
const page = { state: null, received_ms: 0, gateway: null, stream: null, wait: 500, rights: {}, t_us: 0, frozen: false, recording: null, stop: null, newest: null, reads: new AbortController() };

async function ask(method, path, options) {
  const answer = await askProved(method, path, options);
  if (answer.status === 401) askToken();
  return answer;
}

// Ends what has no time limit: it may use the last connection that the browser allows.
function freeConnections() {
  page.stream?.abort();
  page.reads.abort();
  page.reads = new AbortController();
}

async function askJson(path) {
  const answer = await ask("GET", path, { signal: page.reads.signal });
  const body = await answer.json();
  if (!answer.ok) throw new Error(body.message ?? answer.status);
  return body;
}

function askToken() {
  $("login-says").textContent = STRINGS[proof.token ? "token_wrong" : "token_missing"];
  $("login").hidden = false;
  $("main").hidden = true;
  page.stream?.abort();
}

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

// Marks changes of the machine in the plots.
function markChange(before, state) {
  if (!before || before.state === state.state) return;
  const cause = state.cause !== before.cause ? state.cause : null;
  markLive(state.t_us / 1e6, cause ? causeInWords({ cause }) : STRINGS.states[state.state] ?? state.state, toneOf(state.state));
}

function takeState(state) {
  markChange(page.state, state);
  page.state = state;
  forgetDelivered(state);
  page.t_us = state.t_us;
  page.received_ms = performance.now();
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
