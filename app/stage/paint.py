"""Colours for the renderer: from the sRGB that people mean to the light values that show as it. Pure.

viser's renderer treats vertex colours as linear light and then applies three.js' filmic (ACES) curve, which
makes every colour duller and turns white into grey. There is no public switch for it, so colours are put
through the inverse curve first: a mesh of `#0e6fc4` is then `#0e6fc4` on the screen.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float

from study_core.scene import Mesh

# The constants of three.js' ACESFilmicToneMapping (three/src/renderers/shaders/ShaderChunk/tonemapping_pars_fragment).
_INPUT = np.array([[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]])
_OUTPUT = np.array(
    [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]]
)
_PRE_EXPOSURE = 0.6
# The curve reaches full white only at infinity; this much of it looks white and stays a moderate number.
_BRIGHTEST = 0.94

# Towards the light, in the coordinates of a body or scene: above, a little behind and to the right, which are
# the faces that a viewer sees in either layout.
_LIGHT = np.array([0.38, -0.28, 0.82])
_AMBIENT = 0.46


def linear_from_srgb(colour: str) -> Float[np.ndarray, " 3"]:
    """Linear light of `#rrggbb` (further digits are ignored), each component in [0, 1]."""
    srgb = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def alpha_of(colour: str) -> float:
    """Opacity of `#rrggbb` (1) or `#rrggbbaa`."""
    return int(colour[7:9], 16) / 255 if len(colour) == 9 else 1.0


def before_film_curve(shown: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Inverts the renderer's filmic curve.

    Args:
        shown: Linear light that the screen should show, in [0, 1], shape `(n, 3)`.

    Returns:
        Linear light to give to the renderer; may exceed 1.
    """
    curved = np.clip(shown * _BRIGHTEST @ np.linalg.inv(_OUTPUT).T, 0.0, 0.98)
    # The curve is (v^2 + p v - q) / (r v^2 + s v + t); solve for v.
    a = 1 - 0.983729 * curved
    b = 0.0245786 - 0.4329510 * curved
    c = -0.000090537 - 0.238081 * curved
    v = (-b + np.sqrt(b * b - 4 * a * c)) / (2 * a)
    light: Float[np.ndarray, "n 3"] = np.maximum(v @ np.linalg.inv(_INPUT).T, 0.0) * _PRE_EXPOSURE
    return light


def _normals(corners: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "n 3"]:
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    unit: Float[np.ndarray, "n 3"] = normals / np.where(lengths > 0, lengths, 1.0)
    return unit


def shaded(mesh: Mesh, corners: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "n 3"]:
    """Light of each triangle: the mesh's colour exactly where it faces up, darker where it doesn't.

    Args:
        mesh: Tells the colour.
        corners: Its triangles' corners, shape `(n, 3, 3)`.

    Returns:
        Values for the renderer, shape `(n, 3)`.
    """
    light = _LIGHT / np.linalg.norm(_LIGHT)
    lit = _AMBIENT + (1 - _AMBIENT) * np.maximum(_normals(corners) @ light, 0.0) / light[2]
    return before_film_curve(np.minimum(lit, 1.12)[:, None].clip(0.0, 1.12) * linear_from_srgb(mesh.colour))


@lru_cache(maxsize=32)
def flat(colour: str) -> tuple[float, float, float]:
    """Value for the renderer of an unshaded colour."""
    red, green, blue = before_film_curve(linear_from_srgb(colour)[None])[0].tolist()
    return red, green, blue
