// What is measured while a question is on the screen, and sent with its answer.

const MOST_FRAMES = 600;

export class Measures {
  constructor(stage) {
    this.stage = stage;
    this.tally = {};
    this.frames = [];
    this.isOpen = false;
    this.awaySince = null;
    this.clear();
    document.addEventListener("visibilitychange", () => {
      if (document.hidden) this.tally.hidden += 1;
      this.attend();
    });
    addEventListener("blur", () => this.attend());
    addEventListener("focus", () => this.attend());
  }

  /** A new question has come; its time begins with `open`. */
  clear() {
    const nothing = { replays: 0, pauses: 0, speed_changes: 0, scrubs: 0, hidden: 0, out_of_focus_ms: 0 };
    Object.assign(this.tally, nothing);
    this.isOpen = false;
  }

  /** The question is seen, since a time of performance.now(). */
  open(first) {
    this.first = first;
    this.frames = [];
    this.stageFrames = [];
    this.isOpen = true;
    this.awaySince = null;
    this.attend();
    this.time(window, this.frames);
    if (this.stage.frame.contentWindow) this.time(this.stage.frame.contentWindow, this.stageFrames);
  }

  /** Everything measured until now. */
  close(now) {
    this.isOpen = false;
    this.attend(now);
    const { layout } = this.stage;
    return {
      ...this.tally,
      layout,
      out_of_focus_ms: Math.round(this.tally.out_of_focus_ms),
      first_frame: this.first.isSeen ? "seen" : "assumed",
      frame_ms: median(this.frames),
      stage_frame_ms: median(this.stageFrames),
      viewport: [innerWidth, innerHeight],
      device_pixel_ratio: devicePixelRatio,
    };
  }

  /** Adds up the time in which the person is elsewhere. */
  attend(now = performance.now()) {
    if (this.awaySince !== null) this.tally.out_of_focus_ms += now - this.awaySince;
    const isAway = this.isOpen && (document.hidden || !document.hasFocus());
    this.awaySince = isAway ? now : null;
  }

  /** Notes the time between a window's animation frames. */
  time(where, intervals) {
    let before = null;
    const step = (now) => {
      if (!this.isOpen || intervals.length >= MOST_FRAMES) return;
      if (before !== null) intervals.push(now - before);
      before = now;
      where.requestAnimationFrame(step);
    };
    where.requestAnimationFrame(step);
  }
}

/** In tenths of milliseconds; null of nothing. */
function median(values) {
  if (values.length === 0) return null;
  const sorted = [...values].sort((one, other) => one - other);
  return Math.round(10 * sorted[sorted.length >> 1]) / 10;
}
