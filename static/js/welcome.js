// The first page: says before anything is begun if this browser can't show the study.
import { canDraw } from "./webgl.js";

document.getElementById("cannot-draw").hidden = canDraw();
