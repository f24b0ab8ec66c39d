// Sends a form, however often the connection is lost. Sent late or twice, it changes nothing: see app/web/steps.py.
import { tell, wait, word } from "./page.js";

const PATIENCE_MS = 15000; // a request that takes longer is lost
const TO_MEND = 422;

/** Sends the form by script; `dress` is called for the page that comes back if something has to be mended. */
export function sends(form, draft, dress) {
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    if (form.ariaBusy === "true") return;
    form.ariaBusy = "true";
    const response = await insist(form.action, new URLSearchParams(new FormData(form, event.submitter)));
    form.ariaBusy = "false";
    if (response.status === TO_MEND) return mend(await response.text(), dress);
    // It has been taken, or the session is over: the session's one address tells.
    draft.clear();
    location.replace(new URL("./", form.action));
  });
}

async function insist(address, body) {
  for (let pause = 500; ; pause = Math.min(pause * 1.7, 5000)) {
    try {
      const response = await send(address, body);
      tell("");
      return response;
    } catch {
      tell(word("lost"));
      await wait(pause);
    }
  }
}

async function send(address, body) {
  const headers = { Accept: "text/html" };
  const signal = AbortSignal.timeout(PATIENCE_MS);
  // The page that it leads to is loaded by the window.
  const response = await fetch(address, { method: "POST", body, headers, signal, redirect: "manual" });
  // A gateway's error or an overloaded server is a lost connection to the person: it will be tried again.
  if (response.status >= 500 || response.status === 429) throw new Error(`status ${response.status}`);
  return response;
}

function mend(page, dress) {
  const next = new DOMParser().parseFromString(page, "text/html");
  document.querySelector("main").replaceWith(next.querySelector("main"));
  dress();
  document.getElementById("summary").focus();
}
