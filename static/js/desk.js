// The desk keeps itself up to date: every few seconds the page is fetched again, and what is live in it replaced.
// Without this script all of it works, by loading the page again.

const EVERY_MS = 4000;
// With many people a page costs the server more, whose first duty is to them: it is asked for less often.
const REST = 25;
const COPIED_MS = 2000;
const UNITS = [[86400, "day"], [3600, "hour"], [60, "minute"], [1, "second"]];

const byId = (id) => document.getElementById(id);

/** How long ago something was, as people say it. */
function ago(seconds) {
  const [size, unit] = UNITS.find(([each]) => seconds >= each) ?? [1, "second"];
  return new Intl.RelativeTimeFormat("en", { numeric: "auto", style: "short" }).format(-Math.floor(seconds / size), unit);
}

/** Moments of today are told as the time since, all others in the browser's own time zone. */
function tellTimes(where) {
  const now = Date.now();
  for (const time of where.querySelectorAll("time")) {
    const at = new Date(time.dateTime);
    const seconds = Math.max(0, (now - at) / 1000);
    const absolute = at.toLocaleString("en-GB", { dateStyle: "medium", timeStyle: "medium" });
    time.textContent = seconds < 86400 ? ago(seconds) : at.toLocaleString("en-GB", { dateStyle: "medium", timeStyle: "short" });
    time.title = absolute;
  }
}

/** Puts new content in the place of the old, and leaves the reader where they were. */
function replace(old, fresh) {
  const focused = document.activeElement?.id;
  const scroll = [...old.querySelectorAll(".scroll")].map(({ scrollLeft, scrollTop }) => [scrollLeft, scrollTop]);
  const place = [scrollX, scrollY];
  old.replaceChildren(...fresh.childNodes);
  old.querySelectorAll(".scroll").forEach((each, index) => {
    [each.scrollLeft, each.scrollTop] = scroll[index] ?? [0, 0];
  });
  if (focused && document.activeElement?.id !== focused) byId(focused)?.focus({ preventScroll: true });
  scrollTo(...place);
  tellTimes(old);
  wire(old);
}

/** Whether somebody is in the middle of something that new content would take from them. */
function isBusy(live) {
  const active = document.activeElement;
  const isTyping = live.contains(active) && active.matches("input, select, textarea");
  const isMarking = !getSelection().isCollapsed && live.contains(getSelection().anchorNode);
  return document.hidden || isTyping || isMarking;
}

async function refresh(live) {
  let answer;
  try {
    answer = await fetch(location.href, { headers: { "prefstudy-live": "1", accept: "text/html" } });
  } catch {
    byId("notice").textContent = "The server can’t be reached just now. What you see may be old.";
    return true;
  }
  if (answer.status === 401) {
    byId("notice").textContent = "Your login has ended. Load the page again to log in.";
    return false;
  }
  if (!answer.ok) return true;
  byId("notice").textContent = "";
  const page = new DOMParser().parseFromString(await answer.text(), "text/html");
  const fresh = page.getElementById(live.id);
  // What is on the screen has been changed by the script, so the sources are compared.
  if (fresh && fresh.innerHTML !== live.source && !isBusy(live)) {
    live.source = fresh.innerHTML;
    replace(live, fresh);
  }
  const freshness = byId("freshness");
  if (freshness) freshness.textContent = `as of ${new Date().toLocaleTimeString("en-GB")}`;
  return true;
}

async function keepUpToDate(live) {
  let goesOn = true;
  let took = 0;
  while (goesOn) {
    await new Promise((resolve) => setTimeout(resolve, Math.max(EVERY_MS, REST * took)));
    tellTimes(live);
    if (isBusy(live)) continue;
    const begun = performance.now();
    goesOn = await refresh(live);
    took = performance.now() - begun;
  }
}

function wire(where) {
  for (const button of where.querySelectorAll("[data-copies]")) {
    if (!navigator.clipboard) break;
    const label = button.textContent;
    button.hidden = false;
    button.addEventListener("click", async () => {
      await navigator.clipboard.writeText(byId(button.dataset.copies).textContent.trim());
      button.textContent = "Copied";
      byId("notice").textContent = "Copied.";
      setTimeout(() => {
        button.textContent = label;
        byId("notice").textContent = "";
      }, COPIED_MS);
    });
  }
  for (const button of where.querySelectorAll("[data-prints]")) {
    button.hidden = false;
    button.addEventListener("click", () => print());
  }
  for (const choice of where.querySelectorAll(".filter select")) choice.addEventListener("change", () => choice.form.submit());
}

tellTimes(document);
wire(document);
const live = document.querySelector("[data-live]");
if (live) keepUpToDate(live);
