// One participant's page: shows the current question, takes the answer, keeps in step with the server.
// Every address is relative to /s/{token}/.
"use strict";

const REVEAL_MS = 350; // a new picture takes this long to appear; see app/stage/stage.py
const SILENCE_MS = 40000; // the server sends the screen at least every 15 s
const CONNECT_MS = 8000; // a stage whose page has come, but that nobody watches after so long, is loaded again
const DRAW_MS = 15000; // a browser in which drawing can't be noticed has surely drawn by then
const TALL_BELOW = 1.05; // width over height of the window

const byId = (id) => document.getElementById(id);
const wait = (ms) => new Promise((done) => setTimeout(done, ms));
const buttons = [...document.querySelectorAll("[data-choice]")]; // A, B and what else the study offers
const stage = byId("stage");
const notice = byId("notice");
const sample = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });

let screen = { kind: "preparing", position: -1, query_index: null, number: 0, total: 0 };
let shownAt = 0; // when the current question came on screen, in milliseconds of performance.now()
let sending = null; // index of the query whose answer is on its way
let isPaused = false;
let isOffline = false;
let layout = null;
let stageLoadedAt = Infinity; // when the stage's page had come, in milliseconds of performance.now()
let nViewers = 0; // how many stages the server sees on this session
let tally = freshTally();

function freshTally() {
  return { replays: 0, pauses: 0, hidden: 0 };
}

// ---- talking to the server ----

async function request(address, body) {
  const options = { signal: AbortSignal.timeout(15000), headers: { Accept: "application/json" } };
  if (body !== undefined) {
    options.method = "POST";
    options.headers["Content-Type"] = "application/json";
    options.body = JSON.stringify(body);
  }
  const response = await fetch(address, options);
  // A gateway's error or an overloaded server is a lost connection to the person: it will be tried again.
  if (response.status >= 500 || response.status === 429) throw new Error(`status ${response.status}`);
  return response;
}

/** Repeats a request until the server has answered it, telling the person meanwhile. */
async function insist(address, body) {
  for (let pause = 500; ; pause = Math.min(pause * 1.7, 5000)) {
    try {
      const response = await request(address, body);
      setOffline(false);
      return response;
    } catch {
      setOffline(true);
      await wait(pause);
    }
  }
}

function setOffline(value) {
  const isBack = isOffline && !value;
  isOffline = value;
  tellConnection();
  // viser's own client reconnects only while its document has focus, which the stage never has.
  if (isBack) loadStage();
}

function tellConnection() {
  const text = !isOffline
    ? ""
    : sending === null
      ? "Connection lost. Trying again…"
      : "Connection lost. Your answer will be sent as soon as it is back.";
  if (notice.textContent !== text) notice.textContent = text;
}

/** Follows the session to its end, however often the connection is lost. */
async function follow() {
  await hear();
  while (screen.kind !== "finished") {
    setOffline(true);
    await wait(500);
    // An EventSource doesn't tell a refusal from a lost connection; a request for the page does.
    const response = await insist("");
    if (!response.ok) return stop();
    await hear();
  }
}

/** Applies the screens that the server sends, until the session is finished or the connection is lost. */
async function hear() {
  const source = new EventSource("screens");
  await new Promise((end) => {
    let timer = setTimeout(end, SILENCE_MS);
    source.onerror = end;
    source.onmessage = (event) => {
      clearTimeout(timer);
      timer = setTimeout(end, SILENCE_MS);
      setOffline(false);
      apply(JSON.parse(event.data));
      if (screen.kind === "finished") end();
    };
  });
  source.close();
}

/** The server refuses for good (the session is over or unknown): let it say so itself. */
function stop() {
  location.reload();
}

// ---- screens ----

function apply(next) {
  if (next.position < screen.position) return; // an older answer overtook a newer one
  const isNew = next.query_index !== screen.query_index || next.kind !== screen.kind;
  screen = next;
  nViewers = next.stage_viewers ?? nViewers;
  if (nViewers === 0 && performance.now() - stageLoadedAt > CONNECT_MS) loadStage();
  if (isNew) show();
}

function show() {
  document.body.classList.add("is-preparing");
  const { number, total } = screen;
  byId("count").textContent = total > 0 ? `Question ${Math.min(number, total)} of ${total}` : "";
  const bar = byId("bar");
  bar.max = Math.max(total, 1);
  bar.value = screen.kind === "finished" ? bar.max : Math.max(number - 1, 0);
  bar.setAttribute("aria-valuetext", byId("count").textContent);
  if (screen.kind === "finished") return finish();
  setPaused(false);
  tally = freshTally();
  for (const button of buttons) button.disabled = true;
  if (screen.kind === "question") open(screen.query_index);
}

/** Lets the person answer once the new picture is there, so that a double press can't answer it unseen. */
async function open(queryIndex) {
  const isCurrent = () => screen.query_index === queryIndex && screen.kind === "question";
  if (hasDrawn()) document.body.classList.remove("is-preparing");
  await wait(REVEAL_MS);
  while (isCurrent() && !hasDrawn()) await wait(100);
  if (!isCurrent()) return;
  document.body.classList.remove("is-preparing");
  shownAt = performance.now();
  for (const button of buttons) {
    button.classList.remove("is-chosen");
    button.disabled = false;
  }
}

function finish() {
  stage.remove();
  document.querySelector(".trial-page").hidden = true;
  byId("finished").hidden = false;
  byId("finished").querySelector("h1").focus();
}

async function answer(choice, means) {
  const button = byId(`answer-${choice}`);
  if (button.disabled || sending === screen.query_index) return;
  sending = screen.query_index;
  const body = {
    query_index: sending,
    choice,
    response_time_ms: Math.round(performance.now() - shownAt),
    client: {
      means,
      layout,
      ...tally,
      viewport: [innerWidth, innerHeight],
      device_pixel_ratio: devicePixelRatio,
    },
  };
  for (const each of buttons) each.disabled = true;
  button.classList.add("is-chosen");
  tellConnection();
  const response = await insist("answer", body);
  if (sending === body.query_index) sending = null;
  if (!response.ok) return stop();
  const { screen: next } = await response.json();
  // Whatever became of it (taken, already taken, not current), the server's screen is what counts.
  screen.query_index = screen.query_index === body.query_index ? undefined : screen.query_index;
  apply(next);
}

// ---- the stage ----

/** (Re)loads the scene. A server that has been restarted knows nothing of the layout, so it's told first. */
async function loadStage() {
  stageLoadedAt = Infinity;
  setPaused(false);
  await request("stage", { action: layout }).catch(() => undefined);
  // Replaced, so that the browser's back button doesn't step through stages.
  stage.contentWindow?.location.replace(new URL("stage/", location.href));
}

/** Whether the stage shows something: its canvas is transparent until the first picture has been drawn. */
function hasDrawn() {
  const canvas = stage.contentDocument?.querySelector("canvas[data-engine]");
  if (canvas && canvas.width > 0 && canvas.height > 0) {
    sample.clearRect(0, 0, 1, 1);
    sample.drawImage(canvas, 0, 0, 1, 1);
    if (sample.getImageData(0, 0, 1, 1).data[3] === 255) return true;
  }
  return nViewers > 0 && performance.now() - stageLoadedAt > DRAW_MS;
}

/** Asks something of the stage; a stage that can't do it has lost its server and is loaded again. */
async function command(action) {
  try {
    const response = await request("stage", { action });
    if (!response.ok) loadStage();
  } catch {
    setOffline(true); // the next screen from the server tells when it is back
  }
}

function setPaused(value) {
  isPaused = value;
  byId("pause").classList.toggle("is-paused", value);
  byId("pause-label").textContent = value ? "Play" : "Pause";
}

function replay() {
  if (screen.kind !== "question") return;
  tally.replays += 1;
  setPaused(false);
  command("replay");
}

function togglePause() {
  if (screen.kind !== "question") return;
  setPaused(!isPaused);
  if (isPaused) tally.pauses += 1;
  command(isPaused ? "pause" : "resume");
}

function arrange(isFirst) {
  const next = innerWidth / innerHeight < TALL_BELOW ? "tall" : "wide";
  if (next === layout) return;
  layout = next;
  document.body.classList.toggle("tall", next === "tall");
  document.body.classList.toggle("wide", next === "wide");
  if (!isFirst) command(next);
}

/** viser draws nothing without WebGL 2 and doesn't say so. */
function canDraw() {
  try {
    const context = document.createElement("canvas").getContext("webgl2");
    context?.getExtension("WEBGL_lose_context")?.loseContext();
    return Boolean(context);
  } catch {
    return false;
  }
}

function onStageLoad() {
  stageLoadedAt = performance.now();
  // The graphics driver may restart; viser doesn't recover from that, a fresh page does.
  let tries = 0;
  const timer = setInterval(() => {
    const canvas = stage.contentDocument?.querySelector("canvas[data-engine]");
    tries += 1;
    if (canvas) canvas.addEventListener("webglcontextlost", () => setTimeout(loadStage, 1000), { once: true });
    if (canvas || tries > 40) clearInterval(timer);
  }, 250);
}

// ---- hands ----

const KEYS = {
  a: () => answer("a", "keyboard"),
  arrowleft: () => answer("a", "keyboard"),
  b: () => answer("b", "keyboard"),
  arrowright: () => answer("b", "keyboard"),
  r: replay,
};

function onKey(event) {
  if (event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
  const key = event.key.toLowerCase();
  if (key === " ") {
    // On a focused button the space bar presses that button, as everywhere.
    if (event.target instanceof HTMLButtonElement) return;
    event.preventDefault();
    togglePause();
  } else if (Object.hasOwn(KEYS, key)) {
    event.preventDefault();
    KEYS[key]();
  }
}

function start() {
  const first = JSON.parse(byId("screen").textContent);
  if (first.kind === "finished") return apply(first);
  byId("retry").addEventListener("click", () => location.reload());
  if (!canDraw()) {
    byId("no-webgl").hidden = false;
    document.querySelector(".trial-page").inert = true;
    return;
  }
  for (const button of buttons) {
    // `detail` is 0 when a focused button is pressed with the keyboard.
    button.addEventListener("click", (event) =>
      answer(button.dataset.choice, event.detail === 0 ? "keyboard" : event.pointerType || "mouse"),
    );
  }
  byId("replay").addEventListener("click", replay);
  byId("pause").addEventListener("click", togglePause);
  document.addEventListener("keydown", onKey);
  document.addEventListener("visibilitychange", () => {
    if (document.hidden) tally.hidden += 1;
  });
  addEventListener("resize", () => arrange(false));
  stage.addEventListener("load", onStageLoad);
  arrange(true);
  loadStage();
  apply(first);
  follow();
}

start();
