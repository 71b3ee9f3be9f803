// SPDX-License-Identifier: MIT
"use strict";
// The pad: it drives only while a finger or a key is down.

// A mouse or keyboard whose link has failed reports no release. So driving needs a recent report of a movement or a key.
const HAND_WARN_MS = 1000, HAND_STOP_MS = 2000, DRIVE_MS = 100, YAW_MRAD_S = 800, KEY_SHARE = 0.6;
const KEYS = { ArrowUp: [0, -1], ArrowDown: [0, 1], ArrowLeft: [-1, 0], ArrowRight: [1, 0] };
const drive = { on: false, held: false, key: "", sequence: 0, v: 0, yaw: 0, session: 0, hand_ms: 0, pointer: null, keys: new Set() };

const degrees = (mrad_s) => say("pad_turn", { deg: plain(((mrad_s * 180) / Math.PI / 1000).toFixed(0)) });
const motion = (v, yaw) => `${speed(v)} ${unit}, ${degrees(yaw)}`;

function padSays(words) {
  if ($("pad-says").textContent !== words) $("pad-says").textContent = words;
}

function showRights() {
  $("drive").hidden = !page.rights.may_drive;
  document.body.classList.toggle("may-drive", page.rights.may_drive);
  if (drive.on && !page.rights.may_drive) switchPad(false); // The bridge was restarted with other rights.
}

// A place on the pad, from its middle: forward is up, left is left.
function put(id, v, yaw) {
  const clamp = (value) => Math.max(-1, Math.min(1, value));
  $(id).style.left = `${50 - clamp(yaw / YAW_MRAD_S) * 50}%`;
  $(id).style.top = `${50 - clamp(v / page.rights.max_speed_mm_s) * 50}%`;
}

// The measured motion; null unless both wheels and their track are known.
function measuredMotion(state) {
  const left = state?.left.speed_mm_s ?? null, right = state?.right.speed_mm_s ?? null, track = parseFloat(state?.ledger.track?.value);
  return left === null || right === null || !(track > 0) ? null : [(left + right) / 2, ((right - left) * 1000) / track];
}

function showMotion(state) {
  if (!drive.on) return;
  const measured = measuredMotion(state);
  $("ring").hidden = !measured;
  if (measured) put("ring", ...measured);
  text("pad-measured", measured && motion(...measured));
  text("pad-command", motion(drive.v, drive.yaw));
  text("pad-limit", motion(page.rights.max_speed_mm_s, YAW_MRAD_S));
  const fast = speed(page.rights.max_speed_mm_s), turn = degrees(YAW_MRAD_S);
  for (const [id, words] of [["pad-top", `${fast} ${unit}`], ["pad-bottom", `−${fast} ${unit}`], ["pad-left", turn], ["pad-right", turn]]) text(id, words);
}

function aim(x, y) {
  const clamp = (value) => Math.max(-1, Math.min(1, value));
  drive.v = Math.round(-clamp(y) * page.rights.max_speed_mm_s);
  drive.yaw = Math.round(-clamp(x) * YAW_MRAD_S);
  put("knob", drive.v, drive.yaw);
  $("knob").classList.toggle("moved", x !== 0 || y !== 0);
  showMotion(page.state);
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
  const session = ++drive.session, since = page.t_us; // Time at which the pad was pressed, by the machine's own clock.
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

// One command at a time. Each has the newest received time: the bridge drops a late command.
async function feed(session) {
  while (drive.held && session === drive.session) {
    const begun = performance.now(), still_ms = begun - drive.hand_ms;
    if (still_ms > HAND_STOP_MS) return void letGo("why_no_hand");
    const query = new URLSearchParams({ key: drive.key, sequence: ++drive.sequence, t_us: page.t_us, v_mm_s: drive.v, yaw_mrad_s: drive.yaw });
    const answer = await ask("POST", `/api/drive?${query}`, { signal: AbortSignal.timeout(page.rights.ttl_ms) });
    const body = await answer.json();
    if (!answer.ok) throw new Error(body.message);
    padSays(STRINGS[still_ms > HAND_WARN_MS ? "pad_no_hand" : body.limited ? "pad_limited" : "pad_drives"]);
    await new Promise((done) => setTimeout(done, Math.max(0, DRIVE_MS - (performance.now() - begun))));
  }
}

function release(why) {
  if (!drive.held) return;
  drive.held = false;
  drive.session++;
  deliver("stop");
  drive.pointer = null;
  drive.keys.clear();
  $("pad").classList.remove("held");
  aim(0, 0);
  padSays(fill(STRINGS.pad_stopped, { why }));
}

function letGo(name) {
  release(STRINGS[name]);
}

// All arrow keys that are down count: two of them are a curve.
function steer() {
  const sum = [...drive.keys].map((key) => KEYS[key]).reduce(([a, b], [x, y]) => [a + x, b + y], [0, 0]);
  hold(sum[0] * KEY_SHARE, sum[1] * KEY_SHARE);
}

function keyDown(event) {
  if (!KEYS[event.key]) return;
  event.preventDefault();
  hand();
  if (event.repeat) return;
  drive.keys.add(event.key);
  steer();
}

function keyUp(event) {
  if (!drive.keys.delete(event.key)) return;
  if (drive.keys.size) steer(); else letGo("why_let_go");
}

function switchPad(on) {
  letGo("why_off");
  drive.on = on;
  $("drive-off").hidden = on;
  $("drive-on").hidden = !on;
  document.body.classList.toggle("driving", on);
  padSays(STRINGS.pad_ready);
  if (on) aim(0, 0);
  $(on ? "pad" : "arm").focus();
}

function setUpDriving() {
  const pad = $("pad");
  const from = (event) => {
    const box = pad.getBoundingClientRect();
    return [((event.clientX - box.left) / box.width) * 2 - 1, ((event.clientY - box.top) / box.height) * 2 - 1];
  };
  pad.setAttribute("aria-label", STRINGS.pad);
  pad.addEventListener("pointerdown", (event) => {
    if (drive.held || !event.isPrimary) return;
    drive.pointer = event.pointerId;
    pad.setPointerCapture(event.pointerId);
    pad.focus();
    hold(...from(event));
  });
  // A second finger anywhere does not steer: it is a pinch, a palm, or the hand of another person.
  document.addEventListener("pointerdown", (event) => {
    if (!drive.held || event.pointerId === drive.pointer) return;
    letGo("why_second");
    if (pad.contains(event.target)) event.stopPropagation(); // It does not start a drive, either.
  }, true);
  visualViewport.addEventListener("resize", () => letGo("why_view"));
  addEventListener("wheel", (event) => { if (event.ctrlKey) letGo("why_view"); }, { passive: true });
  pad.addEventListener("pointermove", (event) => { if (drive.held && event.pointerId === drive.pointer) { hand(); aim(...from(event)); } });
  for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) pad.addEventListener(name, () => letGo("why_let_go"));
  pad.addEventListener("keydown", keyDown);
  pad.addEventListener("keyup", keyUp);
  pad.addEventListener("blur", () => letGo("why_hidden"));
  pad.addEventListener("contextmenu", (event) => event.preventDefault());
  $("arm").addEventListener("click", async () => { if (await confirmed(STRINGS.ask_arm, STRINGS.ask_arm_yes)) switchPad(true); });
  $("pad-off").addEventListener("click", () => switchPad(false));
}
