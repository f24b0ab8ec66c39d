// Keeps what is typed into a form for as long as the tab is open, so that a reload loses nothing.

export class Draft {
  /** A form without `data-keeps` has nothing to keep. */
  constructor(form) {
    this.form = form;
    this.name = "keeps" in form.dataset ? `${location.pathname.replace(/step$/, "")} ${form.dataset.keeps}` : null;
  }

  get fields() {
    return [...this.form.elements].filter((field) => field.name && !field.name.startsWith("_") && field.type !== "submit");
  }

  restore() {
    const kept = this.name && sessionStorage.getItem(this.name);
    if (!kept) return;
    const values = new Map(JSON.parse(kept));
    for (const field of this.fields) {
      const those = values.get(field.name) ?? [];
      if (["radio", "checkbox"].includes(field.type)) field.checked = those.includes(field.value);
      else field.value = those[0] ?? field.value;
    }
  }

  keep() {
    if (this.name) this.form.addEventListener("input", () => this.write());
  }

  write() {
    const sent = new FormData(this.form);
    const names = new Set(this.fields.map((field) => field.name));
    const values = [...names].map((name) => [name, sent.getAll(name)]);
    sessionStorage.setItem(this.name, JSON.stringify(values));
  }

  /** It has arrived. */
  clear() {
    if (this.name) sessionStorage.removeItem(this.name);
  }
}
