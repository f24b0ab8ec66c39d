// The stage: the frame in which viser draws the clip, and what it shows.
//
// When a picture is first seen. Every clip has a mark in the middle of the picture, below the gutter between the
// sides, in one of eight colours (app/stage/clip.py). viser draws the mark in the same frame as the cars. Browsers
// run a page's animation frame before that of the frames inside it, so what the page finds there in one animation
// frame was drawn in the one before: that one's time is the picture's first.
import { nextFrame, wait } from "./page.js";

const N_MARKS = 8;
const CONNECT_MS = 8000; // a stage whose page has come, but that nobody watches after so long, is loaded again
const UNREADABLE_MS = 15000; // a browser that lets nobody read its pixels has surely drawn by then
const REVEAL_MS = 350; // a new picture takes this long to appear; see app/stage/stage.py
const FULL_HOUSE_MS = 6000;
const TALL_BELOW = 1.05; // width over height of the window

const sample = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
const stillness = matchMedia("(prefers-reduced-motion: reduce)");

export class Stage {
  /** `hears.busy(isBusy)` tells whether all stages are taken, `hears.loaded()` that the stage's page has come. */
  constructor(frame, connection, hears) {
    this.frame = frame;
    this.connection = connection;
    this.hears = hears;
    this.layout = null;
    this.loadedAt = Infinity; // when the stage's page had come, in milliseconds of performance.now()
    this.nViewers = 0; // how many stages the server sees on this session
    this.canRead = false; // whether a mark has ever been read
    this.seen = { mark: null, at: 0 };
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
    this.seen = { mark: null, at: 0 };
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

  /** The number of the picture that the canvas shows, or null while it shows none. */
  mark() {
    const canvas = this.canvas;
    if (!canvas || canvas.width === 0 || canvas.height === 0) return null;
    sample.clearRect(0, 0, 1, 1);
    sample.drawImage(canvas, canvas.width >> 1, canvas.height >> 1, 1, 1, 0, 0, 1, 1);
    const [red, green, blue, alpha] = sample.getImageData(0, 0, 1, 1).data;
    return alpha === 255 ? (red > 127 ? 1 : 0) + (green > 127 ? 2 : 0) + (blue > 127 ? 4 : 0) : null;
  }

  /** Begins to look for the next picture, so that its first frame isn't missed whatever the network does. */
  async watch() {
    if (this.isWatching) return;
    this.isWatching = true;
    let before = await nextFrame();
    while (this.isWatching) {
      const now = await nextFrame();
      const mark = this.mark();
      if (mark !== this.seen.mark) this.seen = { mark, at: before };
      if (mark !== null) this.canRead = true;
      before = now;
    }
  }

  /** Gives when a query's picture was first seen; `isWanted` tells whether anybody still asks. */
  async firstFrame(queryIndex, isWanted) {
    this.watch();
    for (;;) {
      await nextFrame();
      if (!isWanted()) return null;
      if (this.seen.mark === queryIndex % N_MARKS) break;
      if (this.isUnreadable()) return this.assumedFirstFrame(isWanted);
    }
    this.isWatching = false;
    return { at: this.seen.at, isSeen: true };
  }

  isUnreadable() {
    return !this.canRead && this.nViewers > 0 && performance.now() - this.loadedAt > UNREADABLE_MS;
  }

  async assumedFirstFrame(isWanted) {
    await wait(REVEAL_MS);
    return isWanted() ? { at: performance.now(), isSeen: false } : null;
  }
}

/** viser draws nothing without WebGL 2 and doesn't say so. */
export function canDraw() {
  try {
    const context = document.createElement("canvas").getContext("webgl2");
    context?.getExtension("WEBGL_lose_context")?.loseContext();
    return Boolean(context);
  } catch {
    return false;
  }
}
