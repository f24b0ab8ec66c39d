// The keyboard: which key does what, and the dialog in which a person changes that or switches it off (WCAG 2.1.4).
import { byId, word, write } from "./page.js";

const STORED_AS = "prefstudy-keys";
// The arrows mean places on the screen, whatever the direction of writing.
const ARROWS = { arrowleft: "first", arrowup: "first", arrowright: "second", arrowdown: "second" };
const USUAL = {
  first: "a",
  second: "b",
  same: "s",
  unsure: "c",
  skip: "x",
  pause: " ",
  replay: "r",
  undo: "u",
  ...Object.fromEntries([1, 2, 3, 4, 5].map((step) => [`confidence-${step}`, String(step)])),
};
const TYPING = "input, select, textarea, [contenteditable]";

export class Keys {
  /** `acts` has a function for each action that the page offers; while the `page` is inert, none is called. */
  constructor(acts, page) {
    this.acts = acts;
    this.page = page;
    this.dialog = byId("keys-dialog");
    this.chosen = { isOn: true, keys: { ...USUAL }, ...this.stored() };
    this.waitingFor = null; // the action that is getting a new key
    document.addEventListener("keydown", (event) => this.onKey(event));
    byId("keys").addEventListener("click", () => this.dialog.showModal());
    byId("keys-on").addEventListener("change", (event) => this.change({ isOn: event.target.checked }));
    byId("keys-usual").addEventListener("click", () => this.change({ isOn: true, keys: { ...USUAL } }));
    byId("keys-close").addEventListener("click", () => this.dialog.close());
    this.dialog.addEventListener("close", () => this.expect(null));
    for (const row of this.rows) row.addEventListener("click", () => this.expect(row.dataset.action));
    this.show();
  }

  get rows() {
    return this.dialog.querySelectorAll("[data-action]");
  }

  onKey(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
    const key = event.key.toLowerCase();
    if (this.waitingFor !== null) return this.take(event, key);
    if (!this.chosen.isOn || this.dialog.open || this.page.inert || event.target.closest?.(TYPING)) return;
    // On a focused button the space bar presses that button, as everywhere.
    if (key === " " && event.target.closest?.("button, a")) return;
    const action = Object.keys(this.chosen.keys).find((each) => this.chosen.keys[each] === key) ?? ARROWS[key];
    if (!Object.hasOwn(this.acts, action)) return;
    event.preventDefault();
    this.acts[action]();
  }

  // ---- changing them ----

  expect(action) {
    this.waitingFor = action;
    this.show();
  }

  /** The key pressed next is the action's; whatever had it gets the old one. */
  take(event, key) {
    if (key === "tab" || key === "shift") return;
    event.preventDefault();
    const action = this.waitingFor;
    this.waitingFor = null;
    if (key === "escape" || Object.hasOwn(ARROWS, key)) return this.show();
    const keys = { ...this.chosen.keys };
    const other = Object.keys(keys).find((each) => keys[each] === key);
    if (other) keys[other] = keys[action];
    keys[action] = key;
    this.change({ keys });
  }

  change(what) {
    Object.assign(this.chosen, what);
    try {
      localStorage.setItem(STORED_AS, JSON.stringify(this.chosen));
    } catch {
      // Storage is forbidden: the choice holds for this page.
    }
    this.show();
  }

  stored() {
    try {
      const { isOn, keys } = JSON.parse(localStorage.getItem(STORED_AS));
      return { isOn, keys: { ...USUAL, ...keys } };
    } catch {
      return {};
    }
  }

  // ---- showing them ----

  show() {
    const { isOn, keys } = this.chosen;
    byId("keys-on").checked = isOn;
    document.body.classList.toggle("without-keys", !isOn);
    for (const row of this.rows) {
      const { action } = row.dataset;
      write(row.querySelector("kbd"), this.waitingFor === action ? word("press_a_key") : nameOf(keys[action]));
      row.classList.toggle("is-waiting", this.waitingFor === action);
    }
    for (const hint of document.querySelectorAll("[data-key]")) write(hint, nameOf(keys[hint.dataset.key]));
    for (const button of document.querySelectorAll("[data-shortcut]")) {
      const key = keys[button.dataset.shortcut];
      if (isOn) button.setAttribute("aria-keyshortcuts", key === " " ? "Space" : key);
      else button.removeAttribute("aria-keyshortcuts");
    }
  }
}

function nameOf(key) {
  return key === " " ? word("space") : key.length === 1 ? key.toUpperCase() : key;
}
