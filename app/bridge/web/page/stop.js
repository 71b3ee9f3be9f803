// SPDX-License-Identifier: MIT
"use strict";
// STOP, the control that latches, reset, and the confirmation of an action that cannot be undone.

const STOP_TRY_MS = 400;

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

// Repeats the request until the gateway answers, and shows NOT DELIVERED until then. The second control replaces a stop that is
// not delivered yet, never the other way round.
async function deliver(name) {
  deliver.verb = deliver.busy && deliver.verb === "estop" ? "estop" : name;
  if (deliver.busy) return;
  deliver.busy = true;
  let times = 0, why = "";
  showResult(STRINGS.stopping_now);
  for (;;) {
    times++;
    const asked = deliver.verb;
    try {
      const options = { signal: AbortSignal.timeout(STOP_TRY_MS), keepalive: true };
      const answer = await (asked === "stop" ? askStop(options) : ask("POST", "/api/estop", options));
      const body = await answer.json();
      if (answer.ok) {
        showResult(fill(STRINGS.delivered, { state: STRINGS.states[body.state] ?? body.state }), "good");
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
    page.stream?.abort(); // It may use the last connection that the browser allows.
    await new Promise((done) => setTimeout(done, STOP_TRY_MS / 2));
  }
  deliver.busy = false;
}

// The result of a stop disappears with the next state.
function forgetDelivered(state) {
  const said = page.delivered;
  if (!said) return;
  if (state.state === said.state) said.seen = true;
  else if (said.seen || performance.now() - said.ms > 1000) showResult("");
}

function showResult(words, tone = "") {
  page.delivered = null;
  $("delivered").className = tone;
  $("delivered").textContent = words;
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
  const press = () => { letGo("why_let_go"); deliver("stop"); $("ask").close(); };
  $("stop").addEventListener("pointerdown", press); // On touch, not when the finger is lifted.
  $("stop").addEventListener("click", (event) => { if (event.detail === 0) press(); }); // Enter, or a screen reader.
  $("estop-ask").addEventListener("click", async () => { if (await confirmed(STRINGS.ask_estop, STRINGS.ask_estop_yes)) deliver("estop"); });
  $("reset").addEventListener("click", async () => {
    const stop = page.stop; // The stop that the person sees: a later one is not cleared.
    if (await confirmed(STRINGS.ask_reset, STRINGS.ask_reset_yes)) reset(stop);
  });
  document.addEventListener("keydown", (event) => {
    const typing = event.target.matches("input, select") && event.target.type !== "range";
    if (event.key.toLowerCase() === "s" && !typing && !event.ctrlKey && !event.metaKey && !event.altKey && !event.repeat) press();
    if (event.key === "Escape") $("ask").close();
  });
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

function notDelivered(why, times) {
  showResult(STRINGS.not_delivered, "bad");
  $("delivered").append(element("small", { text: fill(STRINGS.not_delivered_why, { why, times }) }));
}
