// The stage: the frame in which viser draws the clip, and what it shows.
//
// When a picture is first seen. Every clip has two small squares in the middle of the picture, below the gutter
// between the sides, in one of eight colours: the mark tells the picture, the flag the clip (app/stage/clip.py).
// viser draws them in the same frame as the cars. Browsers run a page's animation frame before that of the frames
// inside it, so what the page finds there in one animation frame was drawn in the one before: that one's time is
// the picture's first. The page tells the server which clip it sees, and that removes those behind it.
import { nextFrame, wait } from "./page.js";

const N_MARKS = 8;
const CONNECT_MS = 8000; // a stage whose page has come, but that nobody watches after so long, is loaded again
const UNREADABLE_MS = 15000; // a browser that lets nobody read its pixels has surely drawn by then
const APPEARS_MS = 1100; // by then a new picture has appeared even if nobody can see it do so
const FLAG_SHIFT = 0.03; // from the middle along the gutter, in heights of the picture; see app/stage/clip.py
const EXPECT_MS = 1500; // a change that hasn't come by then won't
const FULL_HOUSE_MS = 6000;
const TALL_BELOW = 1.05; // width over height of the window

const sample = new OffscreenCanvas(2, 1).getContext("2d", { willReadFrequently: true });
const stillness = matchMedia("(prefers-reduced-motion: reduce)");

export class Stage {
  /**
   * `hears.busy(isBusy)` tells whether all stages are taken, `hears.loaded()` that the stage's page has come,
   * `hears.seen(playing)`, which may be absent, that a new clip has come on the screen, and how it plays.
   */
  constructor(frame, connection, hears) {
    this.frame = frame;
    this.connection = connection;
    this.hears = hears;
    this.layout = null;
    this.loadedAt = Infinity; // when the stage's page had come, in milliseconds of performance.now()
    this.nViewers = 0; // how many stages the server sees on this session
    this.canRead = false; // whether a mark has ever been read
    this.seen = { mark: null, flag: null, at: 0 };
    this.watchUntil = 0;
    this.isWatching = false;
    frame.addEventListener("load", () => this.onLoad());
    stillness.addEventListener("change", () => this.command(this.motion));
    addEventListener("resize", () => this.arrange());
    // A second device may have rearranged the picture for itself.
    addEventListener("focus", () => this.layout && this.command(this.layout));
  }

  get motion() {
    return stillness.matches ? "still" : "moving";
  }

  // ---- loading ----

  /** (Re)loads the scene. A server that has been restarted knows nothing of the page's wishes, so it is told first. */
  async load() {
    this.loadedAt = Infinity;
    for (const wish of [this.motion, this.layout]) {
      const isBusy = await this.isRefused(wish);
      this.hears.busy(isBusy);
      if (isBusy) return setTimeout(() => this.load(), FULL_HOUSE_MS);
    }
    // Replaced, so that the browser's back button doesn't step through stages.
    this.frame.contentWindow?.location.replace(new URL("stage/", location.href));
  }

  async isRefused(wish) {
    try {
      const response = await this.connection.request("stage", { action: wish });
      return response.status === 409;
    } catch {
      return false; // the next screen from the server tells when it is back
    }
  }

  onLoad() {
    this.loadedAt = performance.now();
    this.seen = { mark: null, flag: null, at: 0 };
    this.hears.loaded();
    // The graphics driver may restart; viser doesn't recover from that, a fresh page does.
    let tries = 0;
    const timer = setInterval(() => {
      const canvas = this.canvas;
      tries += 1;
      canvas?.addEventListener("webglcontextlost", () => setTimeout(() => this.load(), 1000), { once: true });
      if (canvas || tries > 40) clearInterval(timer);
    }, 250);
  }

  /** Takes in how many stages the server sees; a stage that it doesn't see is loaded again. */
  setViewers(nViewers) {
    this.nViewers = nViewers;
    if (nViewers === 0 && performance.now() - this.loadedAt > CONNECT_MS) this.load();
  }

  arrange() {
    const layout = innerWidth / innerHeight < TALL_BELOW ? "tall" : "wide";
    if (layout === this.layout) return;
    const isFirst = this.layout === null;
    this.layout = layout;
    document.body.classList.toggle("tall", layout === "tall");
    document.body.classList.toggle("wide", layout === "wide");
    if (!isFirst) this.command(layout);
  }

  /** Asks something of the stage; gives how the clip plays then, or null. A stage that can't has lost its server. */
  async command(action, value) {
    this.watch();
    try {
      const response = await this.connection.request("stage", { action, value });
      if (response.ok) return await response.json();
      if (response.status === 409) this.load();
    } catch {
      this.connection.setOffline(true); // the next screen from the server tells when it is back
    }
    return null;
  }

  /** How the clip plays: place, end and length in seconds, speed, whether it is paused; or null. */
  async playing() {
    const response = await this.connection.request("stage").catch(() => null);
    return response?.ok ? response.json() : null;
  }

  // ---- what is seen ----

  get canvas() {
    return this.frame.contentDocument?.querySelector("canvas[data-engine]") ?? null;
  }

  /** The mark and the flag of the clip that the canvas shows; null without one. */
  read() {
    const canvas = this.canvas;
    if (!canvas || canvas.width === 0 || canvas.height === 0) return null;
    const [x, y] = [canvas.width >> 1, canvas.height >> 1];
    const shift = Math.round(FLAG_SHIFT * canvas.height);
    sample.clearRect(0, 0, 2, 1);
    sample.drawImage(canvas, x, y, 1, 1, 0, 0, 1, 1);
    if (this.layout === "wide") sample.drawImage(canvas, x + shift, y, 1, 1, 1, 0, 1, 1);
    else sample.drawImage(canvas, x, y - shift, 1, 1, 1, 0, 1, 1);
    const pixels = sample.getImageData(0, 0, 2, 1).data;
    return pixels[3] === 255 ? { mark: numberOf(pixels, 0), flag: numberOf(pixels, 4) } : null;
  }

  /** Looks, frame by frame, for as long as a change is expected: reading pixels takes time, so not always. */
  watch() {
    this.watchUntil = performance.now() + EXPECT_MS;
    if (!this.isWatching) this.look();
  }

  async look() {
    this.isWatching = true;
    let before = await nextFrame();
    while (performance.now() < this.watchUntil) {
      const now = await nextFrame();
      this.take(this.read(), before);
      before = now;
    }
    this.isWatching = false;
  }

  take(found, at) {
    const { mark, flag } = found ?? { mark: null, flag: null };
    if (mark === this.seen.mark && flag === this.seen.flag) return;
    this.seen = { mark, flag, at: mark === this.seen.mark ? this.seen.at : at };
    if (found === null) return;
    this.canRead = true;
    this.tellSeen(flag);
  }

  async tellSeen(flag) {
    const response = await this.connection.request("stage", { action: "seen", value: flag }).catch(() => null);
    if (response?.ok) this.hears.seen?.(await response.json());
  }

  /** Gives when a query's picture was first seen; `isWanted` tells whether anybody still asks. */
  async firstFrame(queryIndex, isWanted) {
    for (;;) {
      this.watch();
      await nextFrame();
      if (!isWanted()) return null;
      if (this.seen.mark === queryIndex % N_MARKS) return { at: this.seen.at, isSeen: true };
      if (this.isUnreadable()) return this.assumedFirstFrame(isWanted);
    }
  }

  isUnreadable() {
    return !this.canRead && this.nViewers > 0 && performance.now() - this.loadedAt > UNREADABLE_MS;
  }

  async assumedFirstFrame(isWanted) {
    await wait(APPEARS_MS);
    return isWanted() ? { at: performance.now(), isSeen: false } : null;
  }
}

/** What a mark's or flag's colour says: a bit in each of red, green and blue. */
function numberOf(pixels, from) {
  return [0, 1, 2].reduce((sum, bit) => sum + (pixels[from + bit] > 127 ? 1 << bit : 0), 0);
}
