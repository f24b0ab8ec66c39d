"""Nothing about the picture may favour a side, and nothing may leave it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.stage.framing import GUTTER, Framing, Layout, frame, half_centres, half_extents, project
from study_core.scene import Bounds

USUAL = Bounds(-0.3, 0.35, -0.44, 4.3)


def corners(bounds: Bounds) -> np.ndarray:
    return np.array(
        [
            (x, y, z)
            for x in (bounds.x_min, bounds.x_max)
            for y in (bounds.y_min, bounds.y_max)
            for z in (0.0, 0.12)
        ]
    )


def shown(framing: Framing, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both sides' points in the pane, in units of its half height."""
    shape = np.array([framing.layout.aspect, 1.0])
    a = project(framing.a.apply(points), framing.layout) * shape
    b = project(framing.b.apply(points), framing.layout) * shape
    return a, b


@st.composite
def any_bounds(draw: st.DrawFn) -> Bounds:
    x = draw(st.floats(-4, 1)), draw(st.floats(0.05, 5))
    y = draw(st.floats(-6, 3)), draw(st.floats(0.05, 9))
    return Bounds(x[0], x[0] + x[1], y[0], y[0] + y[1])


@pytest.mark.parametrize("layout", Layout)
def test_both_sides_have_the_same_scale_rotation_and_depth(layout: Layout) -> None:
    framing = frame(USUAL, layout)
    assert framing.a.scale == framing.b.scale
    np.testing.assert_array_equal(framing.a.rotation, framing.b.rotation)
    assert framing.a.offset[2] == framing.b.offset[2]


@pytest.mark.parametrize("layout", Layout)
def test_a_unit_square_projects_to_the_same_size_on_both_sides(layout: Layout) -> None:
    square = np.array([(x, y + 1.5, 0.0) for x in (-0.5, 0.5) for y in (-0.5, 0.5)])
    a, b = shown(frame(USUAL, layout), square)
    size_a, size_b = np.ptp(a, axis=0), np.ptp(b, axis=0)
    # Exact along the axis in which the sides aren't displaced; parallax remains along the other.
    along = 0 if layout is Layout.WIDE else 1
    assert size_a[along] == pytest.approx(size_b[along], rel=1e-6)
    assert size_a[1 - along] == pytest.approx(size_b[1 - along], rel=1.5e-3)


def test_parallax_moves_nothing_by_a_tenth_of_a_pixel_on_a_car() -> None:
    framing = frame(USUAL, Layout.WIDE)
    car = np.array([(-0.06, 0.0, 0.0), (0.06, 0.0, 0.0)])
    a, b = shown(framing, car)
    pixels_per_unit = 1000 / 2  # a pane of 1000 pixels' height
    assert abs(np.ptp(a[:, 1]) - np.ptp(b[:, 1])) * pixels_per_unit < 0.1


@given(bounds=any_bounds(), layout=st.sampled_from(Layout))
def test_everything_in_the_bounds_lies_in_its_own_half(bounds: Bounds, layout: Layout) -> None:
    framing = frame(bounds, layout)
    for points, centre in zip(shown(framing, corners(bounds)), half_centres(layout), strict=True):
        assert (np.abs(points - centre[:2]) <= half_extents(layout)).all()


@pytest.mark.parametrize("layout", Layout)
def test_the_two_halves_fill_the_picture_but_for_the_gutter(layout: Layout) -> None:
    a, b = half_centres(layout)
    np.testing.assert_array_equal(a, -b)
    np.testing.assert_allclose((np.abs(a)[:2] + half_extents(layout)), (layout.aspect, 1.0))
    [inner] = (np.abs(a)[:2] - half_extents(layout))[(a != 0)[:2]]
    assert inner == pytest.approx(GUTTER / 2)


@pytest.mark.parametrize(("layout", "axis"), [(Layout.WIDE, 0), (Layout.TALL, 1)])
def test_travel_runs_to_the_right_in_wide_and_upwards_in_tall_pictures(layout: Layout, axis: int) -> None:
    a, b = shown(frame(USUAL, layout), np.array([(0.0, 0.0, 0.0), (0.0, 1.0, 0.0)]))
    for start, end in (a, b):
        assert end[axis] > start[axis] + 0.3


@pytest.mark.parametrize("layout", Layout)
def test_usual_drives_share_one_picture(layout: Layout) -> None:
    one = frame(Bounds(-0.3, 0.31, -0.44, 4.3), layout)
    other = frame(Bounds(-0.255, 0.34, -0.4, 3.9), layout)
    np.testing.assert_array_equal(one.a.offset, other.a.offset)
    assert one.a.scale == other.a.scale


@pytest.mark.parametrize("layout", Layout)
def test_a_usual_drive_spans_most_of_the_picture(layout: Layout) -> None:
    axis = 0 if layout is Layout.WIDE else 1
    a, _ = shown(frame(USUAL, layout), corners(USUAL))
    assert np.ptp(a[:, axis]) > 0.88 * 2 * half_extents(layout)[axis]


def test_a_standing_car_is_not_gigantic() -> None:
    framing = frame(Bounds(-0.1, 0.1, -0.1, 0.1), Layout.WIDE)
    assert framing.a.scale * 0.24 < 0.8
