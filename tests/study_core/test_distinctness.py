"""How different two drives look, against poses written down by hand and points computed one by one."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from study_core.distinctness import distinct_rows, visible_difference, visible_paths
from study_core.domains.driving import DRIVING_V1
from study_core.domains.driving.looks import ROBOT_CAR
from study_core.errors import DomainError
from study_core.scene import Track
from tests.study_core import references
from tests.study_core.hills import BOX_LENGTH, N_FRAMES, REACH, HillsDomain


class PosedDomain(HillsDomain):
    """Controls name a list of poses; what is drawn is whatever the test says."""

    def __init__(self, drives):
        super().__init__()
        self.drives = drives

    def scene(self, controls):
        scene = super().scene(np.zeros(2))
        body = scene.tracks[0].body
        drive = self.drives[int(controls[0])]
        tracks = tuple(Track(body, np.array(positions), np.array(yaws)) for positions, yaws in drive)
        return replace(scene, tracks=tracks)


def difference_of(first, second):
    """The visible difference of two drives, each a list of bodies, each `(positions, yaws)`."""
    paths = visible_paths(PosedDomain([first, second]), np.array([[0.0, 0.0], [1.0, 0.0]]))
    return float(visible_difference(paths[:1], paths[1:])[0])


STANDING = ([[0.0, 0.0, 0.0]] * 2, [0.0, 0.0])


@pytest.mark.parametrize(
    ("other", "expected"),
    [
        (STANDING, 0.0),
        (([[BOX_LENGTH, 0.0, 0.0]] * 2, [0.0, 0.0]), 1.0),
        (([[0.0, 0.0, 0.0], [0.0, BOX_LENGTH, 0.0]], [0.0, 0.0]), math.sqrt(0.5)),
        (([[0.0, 0.0, 3.0 * BOX_LENGTH]] * 2, [0.0, 0.0]), 3.0),
        (([[0.0, 0.0, 0.0]] * 2, [math.pi, math.pi]), 1.0),
        (([[0.0, 0.0, 0.0]] * 2, [math.pi / 2, -math.pi / 2]), math.sqrt(0.5)),
        (([[0.0, 0.0, 0.0]] * 2, [2.0 * math.pi, 0.0]), 0.0),
    ],
    ids=[
        "the same",
        "a length aside",
        "a length ahead half of the time",
        "above",
        "turned round",
        "quarter turns",
        "a full turn",
    ],
)
def test_the_difference_is_what_the_two_ends_of_the_body_say(other, expected):
    assert difference_of([STANDING], [other]) == pytest.approx(expected, abs=1e-6)


def test_the_body_that_differs_most_counts():
    aside = ([[BOX_LENGTH, 0.0, 0.0]] * 2, [0.0, 0.0])
    far_aside = ([[0.0, 5.0 * BOX_LENGTH, 0.0]] * 2, [0.0, 0.0])
    assert difference_of([STANDING, STANDING], [aside, far_aside]) == pytest.approx(5.0)
    assert difference_of([STANDING, STANDING], [far_aside, aside]) == pytest.approx(5.0)


def ends_of_the_car(controls):
    """Front and rear of the robot car at each step, the start included."""
    along_the_car = [y for mesh in ROBOT_CAR.meshes for _, y, _ in mesh.vertices]
    length = max(along_the_car) - min(along_the_car)
    points = []
    for x, y, theta, _ in [references.ROBOT_START, *references.drive(references.ROBOT_START, controls)]:
        along = 0.5 * length * np.array([math.cos(theta), math.sin(theta)])
        points.append([np.array([x, y]) + along, np.array([x, y]) - along])
    return np.array(points) / length


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6))
def test_two_drives_of_the_car_differ_by_the_root_mean_square_of_its_ends(seed):
    controls = np.random.default_rng(seed).uniform(-1, 1, (2, 10))
    paths = visible_paths(DRIVING_V1, controls)
    ends = [ends_of_the_car(row) for row in controls]
    squares = [math.dist(p, q) ** 2 for p, q in zip(*(end.reshape(-1, 2) for end in ends), strict=True)]
    expected = math.sqrt(sum(squares) / len(squares))
    assert visible_difference(paths[:1], paths[1:]) == pytest.approx([expected], abs=1e-5)


def test_many_pairs_at_once_are_the_pairs_one_by_one_and_order_does_not_matter():
    paths = visible_paths(DRIVING_V1, np.random.default_rng(1).uniform(-1, 1, (12, 10)))
    together = visible_difference(paths[:6], paths[6:])
    one_by_one = [visible_difference(paths[k : k + 1], paths[6 + k : 7 + k])[0] for k in range(6)]
    np.testing.assert_array_equal(together, one_by_one)
    np.testing.assert_array_equal(together, visible_difference(paths[6:], paths[:6]))
    assert (together > 0.1).all()


def test_distinct_rows_are_those_further_apart_than_the_bound_from_all_before_them():
    # The box slides straight to its goal: goals one unit apart differ by REACH / BOX_LENGTH times this.
    frames = np.linspace(0.0, 1.0, N_FRAMES)
    per_unit = REACH / BOX_LENGTH * math.sqrt((frames**2).mean())
    goals = np.array([0.0, 0.01, 0.3, 0.31, -0.02, 0.32, 0.0])
    paths = visible_paths(HillsDomain(), np.column_stack([goals, np.zeros(7)]))
    assert distinct_rows(paths, 0.015 * per_unit).tolist() == [0, 2, 4, 5]
    assert distinct_rows(paths, 0.0).tolist() == [0, 1, 2, 3, 4, 5]
    assert distinct_rows(paths, 1.0 * per_unit).tolist() == [0]


def test_drives_that_differ_in_any_of_their_bodies_are_distinct():
    aside = ([[0.1 * BOX_LENGTH, 0.0, 0.0]] * 2, [0.0, 0.0])
    drives = [[STANDING, STANDING], [STANDING, aside], [STANDING, STANDING], [aside, STANDING]]
    paths = visible_paths(PosedDomain(drives), np.column_stack([np.arange(4.0), np.zeros(4)]))
    assert distinct_rows(paths, 0.05).tolist() == [0, 1, 3]


def test_scenes_of_several_lengths_are_refused_with_the_remedy():
    short = ([[0.0, 0.0, 0.0]], [0.0])
    with pytest.raises(DomainError, match=r"'hills-v1' to have as many tracks and frames.*: draw the same"):
        difference_of([STANDING], [short])
