// Copies the completion code; it can be selected and copied by hand too.
import { byId, word } from "./page.js";

const SHOWN_MS = 2500;

export function copies() {
  const button = byId("copy");
  if (!button || !navigator.clipboard) return;
  const label = button.textContent;
  button.hidden = false;
  button.addEventListener("click", async () => {
    await navigator.clipboard.writeText(byId("completion-code").textContent);
    button.textContent = word("copied");
    setTimeout(() => (button.textContent = label), SHOWN_MS);
  });
}
