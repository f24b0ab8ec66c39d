// Makes a line of a field for a number from least to most: nothing is on it until the person puts it there.
import { word } from "./page.js";

const { format } = new Intl.NumberFormat(document.documentElement.lang);

/** Puts a slider in the place of the field, which goes on holding the value that is sent. */
export function slides(field) {
  const { least, most, step } = field.dataset;
  const line = field.parentElement;
  const slider = document.createElement("input");
  const output = document.createElement("output");
  Object.assign(slider, { type: "range", min: least, max: most, step, id: field.id });
  // In the middle, from where both ends are as far; nobody sees it there before they have chosen.
  slider.value = (Number(least) + Number(most)) / 2;
  for (const name of ["aria-describedby", "aria-invalid"]) {
    if (field.hasAttribute(name)) slider.setAttribute(name, field.getAttribute(name));
  }
  line.style.setProperty("--intervals", (most - least) / step);
  field.removeAttribute("id");
  field.hidden = true;
  line.querySelector(".hint").textContent = line.dataset.ends;
  line.querySelector(".hint").className = "unseen";
  line.append(slider, output);

  const show = () => {
    const isOpen = field.value === "";
    line.classList.toggle("is-open", isOpen);
    const text = isOpen ? word("unanswered") : word("answered", { value: format(slider.value), most: format(most) });
    output.textContent = text;
    slider.setAttribute("aria-valuetext", text);
  };
  const choose = () => {
    field.value = slider.value;
    show();
    // Whoever keeps the draft hears of the field itself.
    field.dispatchEvent(new Event("input", { bubbles: true }));
  };
  slider.addEventListener("input", choose);
  // A press on the very place where the hidden knob is changes nothing, so the browser tells of no input.
  slider.addEventListener("pointerup", choose);
  slider.addEventListener("keydown", (event) => [" ", "Enter"].includes(event.key) && (event.preventDefault(), choose()));
  if (field.value !== "") slider.value = field.value;
  show();
}
