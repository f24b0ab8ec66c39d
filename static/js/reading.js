// A page that is read or filled in: its form is sent as often as it takes, and keeps what was typed until then.
import { copies } from "./copy.js";
import { Draft } from "./draft.js";
import { counts } from "./counter.js";
import { sends } from "./sending.js";
import { slides } from "./slider.js";

/** Makes a page of what has come, again after an answer that has to be mended. */
function dress() {
  const form = document.querySelector("form[data-sends]");
  copies();
  if (!form) return;
  const draft = new Draft(form);
  // What the server sends back is newer than what was kept here.
  if (!document.getElementById("summary")) draft.restore();
  form.querySelectorAll("input[data-least]").forEach(slides);
  form.querySelectorAll("textarea[data-longest]").forEach(counts);
  draft.keep();
  sends(form, draft, dress);
}

dress();
