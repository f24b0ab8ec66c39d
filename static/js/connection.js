// Talks to the server, however often the connection is lost. Every address is relative to /s/{token}/.
import { wait } from "./page.js";

const PATIENCE_MS = 15000; // a request that takes longer is lost
const SILENCE_MS = 40000; // the server sends the screen at least every 15 s

export class Connection {
  /** `hears.screen(screen)` for every screen, `hears.offline(isOffline)` when the connection is lost or back. */
  constructor(hears) {
    this.hears = hears;
    this.isOffline = false;
  }

  async request(address, body) {
    const options = { signal: AbortSignal.timeout(PATIENCE_MS), headers: { Accept: "application/json" } };
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

  /** Repeats a request until the server has answered it; gives the response and how often it was tried. */
  async insist(address, body) {
    for (let tries = 1, pause = 500; ; tries += 1, pause = Math.min(pause * 1.7, 5000)) {
      try {
        const response = await this.request(address, body);
        this.setOffline(false);
        return { response, tries };
      } catch {
        this.setOffline(true);
        await wait(pause);
      }
    }
  }

  setOffline(value) {
    if (value === this.isOffline) return;
    this.isOffline = value;
    this.hears.offline(value);
  }

  /** Follows the session for as long as the page is open. */
  async follow() {
    await this.hear();
    for (;;) {
      this.setOffline(true);
      await wait(500);
      // An EventSource doesn't tell a refusal from a lost connection; a request for the page does.
      const { response } = await this.insist("");
      if (!response.ok) return this.reload();
      await this.hear();
    }
  }

  /** Hears the screens that the server sends, until the connection is lost. */
  async hear() {
    const source = new EventSource("screens");
    await new Promise((end) => {
      let timer = setTimeout(end, SILENCE_MS);
      source.onerror = end;
      source.onmessage = (event) => {
        clearTimeout(timer);
        timer = setTimeout(end, SILENCE_MS);
        this.setOffline(false);
        this.hears.screen(JSON.parse(event.data));
      };
    });
    source.close();
  }

  /** The server has something else to show, or to say: let it. */
  reload() {
    location.reload();
  }
}
