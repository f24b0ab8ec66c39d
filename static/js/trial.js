// The trial: shows the current question, takes the answer, keeps in step with the server.
import { Connection } from "./connection.js";
import { Keys } from "./keys.js";
import { Measures } from "./measures.js";
import { byId, dataIn, tell, word, write } from "./page.js";
import { Player } from "./player.js";
import { Stage } from "./stage.js";
import { canDraw } from "./webgl.js";

const NEWS_MS = 8000; // how long the person is told what happened
const PAGES = ["welcome", "step", "finished"]; // the server draws these itself
const LETTERS = { first: "A", second: "B" };
const COVERS = ["is-break", "is-busy", "cannot-draw", "is-too-small"]; // what may lie over the trial
const JUDGED = ["first", "second", "same"]; // answers that one can be more or less sure of

const settings = dataIn("settings");
const question = byId("question").textContent;
const answers = [...document.querySelectorAll("[data-choice]")];
const classes = document.body.classList;
const trial = document.querySelector(".trial-page");
const smallness = matchMedia("(max-width: 319px), (max-height: 299px)"); // the drives could hardly be seen

let screen = dataIn("screen");
let shown = ""; // names what the page shows
let first = null; // when the question's picture was first seen
let given = null; // the answer being given: choice, means, time of the press
let sending = null; // index of the query whose answer is on its way
let settled = null; // index of the query that this page has answered or taken back last

const connection = new Connection({ screen: apply, offline: onOffline });
const stage = new Stage(byId("stage"), connection, {
  busy: onBusy,
  loaded: onStageLoaded,
  seen: (playing) => player.onSeen(playing),
});
const measures = new Measures(stage);
const player = new Player(stage, measures.tally, { watched: unlock, remaining: countDown });

// ---- screens ----

const nameOf = ({ kind, step, query_index }) => [kind, step, query_index].join(" ");

function apply(next) {
  if (next.position < screen.position) return; // an older answer overtook a newer one
  if (isElsewhere(next)) tell(word("elsewhere"), NEWS_MS);
  screen = next;
  stage.setViewers(next.stage_viewers ?? stage.nViewers);
  if (PAGES.includes(next.kind)) return connection.reload();
  if (nameOf(next) !== shown) show();
}

/** Whether the question on this page has been answered, but not here. */
function isElsewhere(next) {
  const isGone = screen.kind === "question" && next.query_index !== screen.query_index;
  return isGone && ![sending, settled].includes(screen.query_index);
}

function show() {
  shown = nameOf(screen);
  first = given = null;
  player.close();
  measures.clear();
  lock();
  describe();
  cover("is-break", screen.kind === "break");
  classes.add("is-preparing");
  classes.remove("is-asking");
  if (screen.kind === "question") open();
  if (screen.kind === "break") byId("break-title").focus();
}

/** Writes the question and how far the person is. */
function describe() {
  const { number, total, instructed, is_practice, minutes_left, can_take_back } = screen;
  write(byId("question"), instructed ? word("instructed", { letter: LETTERS[instructed] }) : question);
  const count = total > 0 ? word(is_practice ? "practice_of" : "question_of", { number, total }) : "";
  const left = minutesLeft(minutes_left);
  for (const each of document.querySelectorAll("[data-shows=count]")) write(each, count);
  for (const each of document.querySelectorAll("[data-shows=left]")) write(each, left);
  for (const bar of document.querySelectorAll("progress")) {
    bar.max = Math.max(total, 1);
    bar.value = Math.max(number - 1, 0);
    bar.setAttribute("aria-valuetext", count);
  }
  write(byId("break-done"), word("done", { done: Math.max(number - 1, 0), total }));
  classes.toggle("is-practice", Boolean(is_practice));
  byId("undo").hidden = !(can_take_back && screen.kind === "question");
  byId("undo").disabled = false;
}

function minutesLeft(minutes) {
  if (minutes == null) return "";
  return minutes > 1 ? word("minutes_left", { minutes }) : word("one_minute_left");
}

/** Waits until the picture is seen; from then on the person may answer, if they need not watch it first. */
async function open() {
  const name = shown;
  const seen = await stage.firstFrame(screen.query_index, () => shown === name);
  if (seen === null) return;
  first = seen;
  classes.remove("is-preparing");
  measures.open(first);
  player.open();
  if (!settings.watch_once) unlock();
}

function lock() {
  for (const button of answers) button.disabled = true;
}

function unlock() {
  for (const button of answers) {
    button.disabled = false;
    button.classList.remove("is-chosen", "is-saved");
  }
  describeAnswers(word("prefer"));
}

function countDown(seconds) {
  if (settings.watch_once) describeAnswers(word("wait_seconds", { seconds: Math.ceil(seconds) }));
}

function describeAnswers(text) {
  for (const verb of document.querySelectorAll(".answer-verb")) write(verb, text);
}

// ---- answers ----

function choose(choice, means) {
  const button = byId(`answer-${choice}`);
  if (!button || button.disabled || first === null || sending === screen.query_index) return;
  given = { choice, means, at: performance.now() };
  for (const each of answers) each.classList.toggle("is-chosen", each === button);
  if (settings.confidence && JUDGED.includes(choice)) return askHowSure();
  send();
}

function askHowSure() {
  classes.add("is-asking");
  byId("confidence-question").focus();
}

/** Takes the choice back before it has been sent. */
function thinkAgain() {
  if (!classes.contains("is-asking")) return;
  classes.remove("is-asking");
  given = null;
  for (const each of answers) each.classList.remove("is-chosen");
}

function answerSure(confidence) {
  if (!classes.contains("is-asking")) return;
  classes.remove("is-asking");
  given.confidence = confidence;
  given.confidence_time_ms = Math.round(performance.now() - given.at);
  send();
}

async function send() {
  const { choice, means, at, confidence, confidence_time_ms } = given;
  const query_index = (sending = screen.query_index);
  const response_time_ms = Math.max(0, Math.round(at - first.at));
  const client = { means, confidence_time_ms, ...measures.close(at) };
  lock();
  stage.watch();
  tellConnection();
  const { response, tries } = await connection.insist("answer", {
    query_index,
    choice,
    response_time_ms,
    confidence,
    client,
  });
  if (!response.ok) return connection.reload();
  const { outcome, screen: next } = await response.json();
  // The server may have said long before that it has the answer, and the person may have given the next one.
  if (sending !== query_index) return apply(next);
  settle(query_index);
  // An answer that had to be sent again may have been taken the first time.
  if (outcome === "taken") showSaved(choice);
  else if (tries === 1) tell(word("elsewhere"), NEWS_MS);
  apply(next);
}

/** The server has spoken: whatever became of the answer, its screen is what counts. */
function settle(queryIndex) {
  sending = null;
  settled = queryIndex;
  if (screen.query_index === queryIndex) shown = "";
}

function showSaved(choice) {
  byId(`answer-${choice}`).classList.add("is-saved");
  write(byId("saved"), word("saved"));
  setTimeout(() => write(byId("saved"), ""), 1000);
}

async function undo() {
  const button = byId("undo");
  if (button.hidden || button.disabled || sending !== null) return;
  button.disabled = true;
  await act("take-back", screen.query_index - 1);
}

/** Asks for what changes the screen by itself. */
async function act(address, query_index) {
  const before = shown;
  settled = screen.query_index;
  stage.watch();
  const { response } = await connection.insist(address, { query_index });
  if (!response.ok) return connection.reload();
  const { screen: next } = await response.json();
  if (shown === before) shown = "";
  apply(next);
}

// ---- what happens around it ----

function onOffline(isOffline) {
  tellConnection();
  if (isOffline) return;
  tell(word("back"), NEWS_MS / 2);
  // viser's own client reconnects only while its document has focus, which the stage never has.
  stage.load();
}

function tellConnection() {
  if (connection.isOffline) tell(word(sending === null ? "lost" : "lost_with_answer"));
}

function onBusy(isBusy) {
  cover("is-busy", isBusy);
}

/** Shows one of the pages that cover the trial, or hides it. */
function cover(name, isShown) {
  classes.toggle(name, isShown);
  trial.inert = COVERS.some((each) => classes.contains(each));
}

/** A stage that has been loaded again starts its clip anew. */
async function onStageLoaded() {
  const name = shown;
  if (first !== null && (await stage.firstFrame(screen.query_index, () => shown === name))) player.sync();
}

// ---- hands ----

function onAnswerClick(event) {
  // `detail` is 0 when a focused button is pressed with the keyboard.
  const means = event.detail === 0 ? "keyboard" : event.pointerType || "mouse";
  choose(event.currentTarget.dataset.choice, means);
}

function takeKeys() {
  const acts = { replay: () => player.replay(), pause: () => player.toggle(), undo };
  for (const { dataset } of answers) acts[dataset.choice] = () => choose(dataset.choice, "keyboard");
  for (const button of document.querySelectorAll("[data-confidence]")) {
    const step = Number(button.dataset.confidence);
    button.addEventListener("click", () => answerSure(step));
    acts[`confidence-${step}`] = () => answerSure(step);
  }
  new Keys(acts, trial);
}

function takeHands() {
  for (const button of answers) button.addEventListener("click", onAnswerClick);
  byId("undo").addEventListener("click", undo);
  byId("go-on").addEventListener("click", () => act("break", screen.query_index));
  document.addEventListener("keydown", (event) => event.key === "Escape" && thinkAgain());
  // The back button may bring the page back as it was, deaf.
  addEventListener("pageshow", (event) => event.persisted && connection.reload());
  byId("think-again")?.addEventListener("click", thinkAgain);
  takeKeys();
}

function start() {
  byId("retry").addEventListener("click", () => location.reload());
  if (!canDraw()) return cover("cannot-draw", true);
  cover("is-too-small", smallness.matches);
  smallness.addEventListener("change", () => cover("is-too-small", smallness.matches));
  takeHands();
  stage.arrange();
  stage.load();
  show();
  connection.follow();
}

start();
