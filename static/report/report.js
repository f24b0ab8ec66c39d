// Pointing at a person: with the buttons above, which stay pressed, or with the mouse at what is theirs in a figure.
"use strict";

const buttons = [...document.querySelectorAll("nav button")];
const parts = [...document.querySelectorAll("svg [data-person]")];
let pressed = null;

function show(person) {
  for (const svg of document.querySelectorAll(".picture > svg")) {
    const isThere = [...svg.querySelectorAll("[data-person]")].some((part) => part.dataset.person === person);
    svg.classList.toggle("pointing", isThere);
  }
  for (const part of parts) part.classList.toggle("chosen", part.dataset.person === person);
}

for (const part of parts) {
  const title = document.createElementNS("http://www.w3.org/2000/svg", "title");
  title.textContent = `person ${part.dataset.person}`;
  part.prepend(title);
  part.addEventListener("mouseenter", () => show(part.dataset.person));
  part.addEventListener("mouseleave", () => show(pressed));
}

for (const button of buttons) {
  button.addEventListener("click", () => {
    pressed = pressed === button.dataset.person ? null : button.dataset.person;
    for (const other of buttons) other.setAttribute("aria-pressed", String(other.dataset.person === pressed));
    show(pressed);
  });
}
