// What every part of the page uses: its elements, its texts in the person's language, its one line of news.

export const byId = (id) => document.getElementById(id);
export const wait = (ms) => new Promise((done) => setTimeout(done, ms));
export const nextFrame = () => new Promise((draw) => requestAnimationFrame(draw));
export const dataIn = (id) => JSON.parse(byId(id).textContent);

const words = dataIn("words");

/** A text of the page with its {names} filled in. */
export function word(name, values = {}) {
  return words[name].replace(/\{(\w+)\}/g, (_, key) => values[key]);
}

/** Writes a text where it is new, so that a screen reader says it once. */
export function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

const notice = byId("notice");
let expiry = 0;

/** Tells the person something, for good or for a while. */
export function tell(text, forMs = 0) {
  clearTimeout(expiry);
  write(notice, text);
  if (forMs > 0) expiry = setTimeout(() => write(notice, ""), forMs);
}
