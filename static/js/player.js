// Plays the clip: play and pause, replay, speed, and a slider over the loop's time. Both sides have one clock.
//
// The server builds every clip; the page keeps a clock of its own beside it, set by each of the server's replies,
// for the slider and for how much of the loop has been watched.
import { byId, wait, word, write } from "./page.js";

const SEEK_MS = 1000; // a picture that hasn't appeared by then is no longer waited for
const STEP_S = 0.6; // whoever goes on from what they have watched by no more has watched on

const button = byId("pause");
const slider = byId("scrub");
const speeds = byId("speed");
const tenths = new Intl.NumberFormat(document.documentElement.lang, {
  minimumFractionDigits: 1,
  maximumFractionDigits: 1,
});

export class Player {
  /** `hears.watched()` once both drives have been shown to their end, `hears.remaining(seconds)` until then. */
  constructor(stage, tally, hears) {
    this.stage = stage;
    this.tally = tally;
    this.hears = hears;
    this.clock = { position_s: 0, end_s: Infinity, duration_s: 1, speed: 1, is_paused: false, at: 0 };
    this.watchedTo = 0;
    this.isOpen = false;
    this.isDragged = false;
    this.wanted = null; // where the person wants to be, while the stage is on its way
    this.seeking = Promise.resolve();
    byId("replay").addEventListener("click", () => this.replay());
    byId("play").addEventListener("click", () => this.toggle());
    button.addEventListener("click", () => this.toggle());
    speeds.addEventListener("change", () => this.setSpeed(Number(speeds.value)));
    slider.addEventListener("pointerdown", () => this.grab());
    slider.addEventListener("input", () => this.scrub());
    slider.addEventListener("change", () => this.release());
  }

  /** A new picture is seen: its clock begins. */
  open() {
    this.isOpen = true;
    this.watchedTo = 0;
    // Until the server has said more.
    this.clock = { ...this.clock, position_s: 0, at: performance.now() };
    this.showPaused(this.stage.motion === "still");
    this.follow();
    this.sync();
  }

  /** Asks the server how the clip plays. */
  async sync() {
    this.setClock(await this.stage.playing());
  }

  /** A new clip is on the screen. */
  onSeen(playing) {
    this.setClock(playing);
    this.seen?.();
  }

  /** The picture is answered, or gone. */
  close() {
    this.isOpen = false;
  }

  // ---- the clock ----

  setClock(playing) {
    if (playing === null) return;
    this.clock = { ...playing, at: performance.now() };
    slider.max = playing.duration_s;
    speeds.value = String(playing.speed);
    this.showPaused(playing.is_paused);
  }

  get position() {
    const { position_s, duration_s, speed, is_paused, at } = this.clock;
    if (is_paused) return position_s;
    return (position_s + (speed * (performance.now() - at)) / 1000) % duration_s;
  }

  /** Moves the slider along, frame by frame; a page in the background has no frames and watches nothing. */
  follow() {
    const step = () => {
      if (!this.isOpen) return;
      if (!this.isDragged && this.wanted === null) slider.value = this.position;
      this.watchOn(Number(slider.value));
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  watchOn(position) {
    const { end_s, speed } = this.clock;
    if (this.watchedTo >= end_s || end_s === Infinity) return;
    if (position > this.watchedTo && position - this.watchedTo < STEP_S) this.watchedTo = position;
    if (this.watchedTo >= end_s) this.hears.watched();
    else this.hears.remaining((end_s - this.watchedTo) / speed);
  }

  showPaused(isPaused) {
    this.clock.is_paused = isPaused;
    button.classList.toggle("is-paused", isPaused);
    write(byId("pause-label"), word(isPaused ? "play" : "pause"));
    byId("play").hidden = !(isPaused && this.stage.motion === "still" && this.position === 0);
  }

  // ---- what the person does ----

  async command(action, value) {
    this.setClock(await this.stage.command(action, value));
  }

  replay() {
    if (!this.isOpen) return;
    this.tally.replays += 1;
    this.clock = { ...this.clock, position_s: 0, at: performance.now() };
    this.showPaused(false);
    this.command("replay");
  }

  toggle() {
    if (!this.isOpen) return;
    const isPaused = !this.clock.is_paused;
    if (isPaused) this.tally.pauses += 1;
    this.clock = { ...this.clock, position_s: this.position, at: performance.now() };
    this.showPaused(isPaused);
    this.command(isPaused ? "pause" : "resume");
  }

  setSpeed(speed) {
    this.tally.speed_changes += 1;
    this.command("speed", speed);
  }

  /** Takes hold of the slider: the cars stand still until it is let go. */
  grab() {
    this.isDragged = true;
    this.wasPlaying = !this.clock.is_paused;
    if (this.wasPlaying) this.command("pause");
  }

  scrub() {
    slider.setAttribute("aria-valuetext", word("seconds", { seconds: tenths.format(slider.value) }));
    this.seek(Number(slider.value));
  }

  async release() {
    this.tally.scrubs += 1;
    if (!this.isDragged) return;
    await this.seeking;
    this.isDragged = false;
    if (this.wasPlaying && this.clock.is_paused) this.command("resume");
  }

  /** Goes to a place; while one place is on its way to the screen, only the last of those wanted next counts. */
  seek(position) {
    const isOnTheWay = this.wanted !== null;
    this.wanted = position;
    if (!isOnTheWay) this.seeking = this.reachWanted();
  }

  async reachWanted() {
    for (let position = null; position !== this.wanted; ) {
      position = this.wanted;
      const isThere = new Promise((done) => (this.seen = done));
      await this.command("seek", position);
      await Promise.race([isThere, wait(SEEK_MS)]);
    }
    this.wanted = null;
  }
}
