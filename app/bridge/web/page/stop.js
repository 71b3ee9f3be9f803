// SPDX-License-Identifier: MIT
"use strict";
// STOP, the control that latches, reset, and the confirmation of an action that cannot be undone.
// STOP needs no other script, so it acts although one is missing or fails.

const $ = (id) => document.getElementById(id);

// A request is repeated every STOP_AGAIN_MS, and lasts longer: on a slow network its answer comes late. Those of both verbs fit
// into the six connections of a browser. STOP_GAP_MS: fingers that drum on the button do not fill them.
const STOP_AGAIN_MS = 400, STOP_LIFE_MS = 1200, STOP_GAP_MS = 200;
const STOPS = {
  stop: (options) => fetch("/api/stop", { method: "POST", cache: "no-store", credentials: "omit", ...options }), // Needs no proof, and waits for none.
  estop: (options) => ask("POST", "/api/estop", options),
};

// By verb, what a person has pressed: {done: executed, refused: needs the token, times: attempts, ms: of the last one, why: not delivered, state: in the answer}.
const orders = {};
const isOpen = (one) => one !== undefined && !one.done && !one.refused;
const stopIsOpen = () => Object.values(orders).some(isOpen);

// A press sends a request immediately: it waits for no earlier one, whose answer may never come.
// The control that latches needs the token, and more of this page and of the browser: STOP always goes with it.
function deliver(verb) {
  if (!isOpen(orders.estop)) delete orders.estop;
  order("stop");
  if (verb === "estop") order("estop");
  showOrders();
}

function order(verb) {
  const one = isOpen(orders[verb]) ? orders[verb] : { done: false, refused: false, times: 0, ms: -STOP_GAP_MS, why: null, state: null };
  if (performance.now() - one.ms < STOP_GAP_MS) return;
  orders[verb] = one;
  clearInterval(one.timer);
  one.timer = setInterval(() => repeat(verb, one), STOP_AGAIN_MS);
  attempt(verb, one);
}

function repeat(verb, one) {
  attempt(verb, one);
  one.why ??= STRINGS.no_answer;
  showOrders();
  freeConnections();
}

async function attempt(verb, one) {
  one.times++;
  one.ms = performance.now();
  const control = new AbortController();
  setTimeout(() => control.abort(), STOP_LIFE_MS); // Some browsers have no AbortSignal.timeout.
  try {
    const answer = await STOPS[verb]({ signal: control.signal, keepalive: true });
    const { state, error, message = STRINGS.no_answer } = await answer.json();
    if (!isOpen(one)) return;
    Object.assign(one, { done: answer.ok, refused: verb === "estop" && error === "bad_token", state, why: answer.ok ? null : String(message) });
  } catch {
    if (!isOpen(one)) return;
    one.why = STRINGS.no_answer;
  }
  if (!isOpen(one)) clearInterval(one.timer);
  showOrders();
}

// Shows NOT DELIVERED until the gateway has answered.
function showOrders() {
  const { stop, estop } = orders;
  if (estop?.done) showDelivered(estop);
  else if (!stop.done && stop.why) showMissed(STRINGS.not_delivered, say("not_delivered_why", { ...stop, why: stop.why.replace(`${STRINGS.not_delivered}: `, "") }));
  else if (stop.done && estop?.why) showMissed(STRINGS.not_latched, say(estop.refused ? "not_latched_token" : "not_delivered_why", estop));
  else if (stop.done && !estop) showDelivered(stop);
  else showResult(STRINGS.stopping_now);
}

let shown = null; // The answer that is shown: it disappears with the next state.

function showDelivered({ state }) {
  showResult(fill(STRINGS.delivered, { state: STRINGS.states[state] ?? state }), "good");
  shown = { state, seen: false, ms: performance.now() };
}

function forgetDelivered({ state }) {
  if (!shown) return;
  if (state === shown.state) shown.seen = true;
  else if (shown.seen || performance.now() - shown.ms > 1000) showResult("");
}

function showResult(words, tone = "") {
  shown = null;
  $("delivered").className = tone;
  $("delivered").textContent = words;
}

function showMissed(words, why) {
  const small = document.createElement("small");
  small.textContent = why;
  showResult(words, "bad");
  $("delivered").append(small);
}

// Requests one confirmation of an action that cannot be undone.
// Not modal: a modal dialog would make STOP inert. STOP answers it with no.
function confirmed(text, yes) {
  const dialog = $("ask"), before = document.activeElement;
  dialog.onclose?.(); // Another confirmation replaces it.
  $("ask-says").textContent = text;
  $("ask-yes").textContent = yes;
  if (!dialog.open) dialog.show();
  $("ask-no").focus({ preventScroll: true });
  dialog.scrollTop = 0; // In large text the question is longer than the screen: begin at its first line.
  return new Promise((done) => {
    $("ask-yes").onclick = () => { done(true); dialog.close(); };
    $("ask-no").onclick = () => dialog.close();
    dialog.onclose = () => { done(false); dialog.onclose = null; before?.focus(); };
  });
}

// The page is not zoomed by touch (page.css), but some browsers zoom every page: the bar then stays at its size and place, measured from its lower edge.
function keepStopInSight() {
  const seen = visualViewport, bar = $("bar"), factor = 1 / seen.scale;
  bar.style.transform = "";
  if (factor > 0.99) return;
  const place = bar.getBoundingClientRect();
  const x = seen.offsetLeft + place.left * factor, y = seen.offsetTop + seen.height - (innerHeight - place.top) * factor;
  bar.style.transform = `translate(${x - place.left}px, ${y - place.top}px) scale(${factor})`;
}

// Content below or next to the bar can be scrolled into view.
function makeRoomForStop() {
  const bar = $("bar"), column = bar.offsetWidth < document.documentElement.clientWidth; // innerWidth has the scrollbar, too.
  document.documentElement.style.setProperty("--bar-b", column ? "0px" : `${bar.offsetHeight}px`);
  document.documentElement.style.setProperty("--bar-r", column ? `${bar.offsetWidth}px` : "0px");
  keepStopInSight();
}

function setUpStop() {
  const press = () => { deliver("stop"); letGo("why_let_go"); $("ask").close(); };
  $("stop").addEventListener("pointerdown", press); // On touch, not when the finger is lifted.
  $("stop").addEventListener("click", press); // Enter, a screen reader, a browser without pointer events; also after each pointerdown.
  $("estop-ask").addEventListener("click", async () => { if (await confirmed(STRINGS.ask_estop, STRINGS.ask_estop_yes)) deliver("estop"); });
  $("reset").addEventListener("click", async () => {
    const stop = page.stop; // The stop that the person sees: a later one is not cleared.
    if (await confirmed(STRINGS.ask_reset, STRINGS.ask_reset_yes)) reset(stop);
  });
  document.addEventListener("keydown", (event) => {
    if (event.key?.toLowerCase() === "s" && event.target !== $("token") && !event.ctrlKey && !event.metaKey && !event.altKey && !event.repeat) press();
    if (event.key === "Escape") $("ask").close();
  });
  $("bar").hidden = false; // Only now: no STOP is shown that does not act.
  visualViewport.addEventListener("resize", keepStopInSight);
  visualViewport.addEventListener("scroll", keepStopInSight);
  new ResizeObserver(makeRoomForStop).observe($("bar"));
  addEventListener("resize", makeRoomForStop);
}

async function reset(stop) {
  try {
    const query = new URLSearchParams({ boot: await bootOf(), t_us: page.t_us, stop });
    const body = await (await ask("POST", `/api/reset?${query}`, { signal: AbortSignal.timeout(ASK_MS) })).json();
    showResult(body.ok ? "" : fill(STRINGS.refused, { why: body.message }));
  } catch {
    showResult(fill(STRINGS.refused, { why: STRINGS.no_answer }));
  }
}

setUpStop();
