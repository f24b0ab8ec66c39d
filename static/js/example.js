// The example of the instructions: a stage that can be paused and played again.
import { Connection } from "./connection.js";
import { byId, wait, word, write } from "./page.js";
import { Stage } from "./stage.js";
import { canDraw } from "./webgl.js";

const connection = new Connection({ screen: onScreen, offline: (isOffline) => !isOffline && stage.load() });
const stage = new Stage(byId("stage"), connection, { busy: () => undefined, loaded: onLoaded });
let isPaused = stage.motion === "still";

/** Another window of the same person has gone on: so does this one. */
function onScreen(screen) {
  stage.setViewers(screen.stage_viewers ?? stage.nViewers);
  if (screen.kind !== "step" || String(screen.step) !== document.querySelector("[name=_step]").value) {
    connection.reload();
  }
}

async function onLoaded() {
  byId("pause").disabled = byId("replay").disabled = false;
  showPaused(stage.motion === "still");
  while (stage.read() === null) await wait(100);
  byId("example").classList.add("is-shown");
}

function showPaused(value) {
  isPaused = value;
  write(byId("pause"), word(value ? "play" : "pause"));
}

byId("pause").addEventListener("click", () => {
  showPaused(!isPaused);
  stage.command(isPaused ? "pause" : "resume");
});
byId("replay").addEventListener("click", () => {
  showPaused(false);
  stage.command("replay");
});

if (canDraw()) {
  stage.arrange();
  stage.load();
  connection.follow();
} else {
  byId("example").hidden = true;
}
