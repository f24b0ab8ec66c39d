// Whether this browser can show the stage at all.

/** viser draws nothing without WebGL 2 and doesn't say so. */
export function canDraw() {
  try {
    const context = document.createElement("canvas").getContext("webgl2");
    context?.getExtension("WEBGL_lose_context")?.loseContext();
    return Boolean(context);
  } catch {
    return false;
  }
}
