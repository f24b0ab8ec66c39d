"""Colours appear on the screen as they are written."""

from __future__ import annotations

import numpy as np
import pytest

from app.stage import paint
from study_core.domains.driving.cars import HUMAN_CAR, ROBOT_CAR
from study_core.domains.driving.ground import BACKGROUND, ground
from study_core.scene import Bounds, Mesh


def film_curve(light: np.ndarray) -> np.ndarray:
    """three.js' ACESFilmicToneMapping at exposure 1, written out from its shader."""
    into = np.array([[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]])
    out = np.array(
        [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]]
    )
    v = into @ (light / 0.6)
    v = (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081)
    return np.clip(out @ v, 0, 1)


def on_screen(light: np.ndarray) -> np.ndarray:
    linear = film_curve(light)
    return 255 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


COLOURS = sorted(
    {mesh.colour for body in (ROBOT_CAR, HUMAN_CAR) for mesh in body.meshes if len(mesh.colour) == 7}
    | {mesh.colour for mesh in ground(Bounds(-0.3, 0.3, -0.4, 4.3))}
    | {BACKGROUND, "#808080", "#ffffff", "#000000"}
)


@pytest.mark.parametrize("colour", COLOURS)
def test_a_colour_survives_the_renderers_film_curve(colour: str) -> None:
    meant = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    # A few levels are given away so that white stays a moderate number, and where the curve can't go.
    np.testing.assert_allclose(on_screen(np.array(paint.flat(colour))), meant, atol=12)


def test_a_face_that_looks_up_has_its_meshs_colour_and_others_are_darker() -> None:
    corners = np.array(
        [
            [(0, 0, 0), (1, 0, 0), (0, 1, 0)],
            [(0, 0, 0), (0, 0, 1), (0, 1, 0)],
            [(0, 0, 0), (0, 1, 0), (1, 0, 0)],
        ],
        dtype=float,
    )
    mesh = Mesh(corners.reshape(-1, 3), np.arange(9).reshape(-1, 3), "#0e6fc4")
    up, left, down = paint.shaded(mesh, corners)
    assert up == pytest.approx(paint.flat("#0e6fc4"))
    assert (left < up).all()
    assert (down < up).all()


def test_two_more_digits_are_opacity() -> None:
    assert paint.alpha_of("#00000080") == pytest.approx(0.5, abs=0.01)
    assert paint.alpha_of("#000000") == 1.0
