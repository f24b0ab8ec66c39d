// Tells how much of the room for a text is used.
import { word } from "./page.js";

const { format } = new Intl.NumberFormat(document.documentElement.lang);
const TOLD_FROM = 0.8; // nobody needs to hear of it before

export function counts(field) {
  const longest = Number(field.dataset.longest);
  const count = document.createElement("p");
  count.className = "count";
  field.after(count);
  const show = () => {
    const n = [...field.value].length;
    count.textContent = n < TOLD_FROM * longest ? "" : word("characters", { n: format(n), longest: format(longest) });
    count.classList.toggle("is-over", n > longest);
  };
  field.addEventListener("input", show);
  show();
}
