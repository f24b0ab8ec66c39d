import numpy as np
import pytest

from study_core.domains.driving.domain import DRIVING_V1
from study_core.domains.driving.dynamics import HUMAN_PATH
from study_core.domains.driving.safety import CAR_LENGTH, CAR_WIDTH, collides, stays_on_road


def beside(across=0.0, along=0.0, turned=0.0):
    states = HUMAN_PATH[1:].copy()
    states[:, 0] += across
    states[:, 1] += along
    states[:, 2] += turned
    return states[None]


@pytest.mark.parametrize(
    ("offsets", "does"),
    [
        ({}, True),
        ({"along": 0.9 * CAR_LENGTH}, True),
        ({"along": 1.2 * CAR_LENGTH}, False),
        ({"across": 3.0 * CAR_WIDTH}, False),
        # Crosswise, a car is as wide as it is long.
        ({"along": 0.6 * CAR_LENGTH, "turned": np.pi / 2}, True),
        ({"along": 0.9 * CAR_LENGTH, "turned": np.pi / 2}, False),
    ],
)
def test_cars_collide_when_their_outlines_overlap(offsets, does):
    assert collides(beside(**offsets))[0] == does


def test_overlap_agrees_with_points_thrown_at_random():
    rng = np.random.default_rng(1)
    states = DRIVING_V1.rollout(rng.uniform(-1.0, 1.0, (200, 10)))
    thrown = rng.uniform(-0.5, 0.5, (400, 2)) * (CAR_WIDTH, CAR_LENGTH)
    hit = np.zeros(len(states), dtype=bool)
    for step in range(50):
        x, y, heading, _ = states[:, step].T
        right = np.stack([np.sin(heading), -np.cos(heading)], axis=-1)
        ahead = np.stack([np.cos(heading), np.sin(heading)], axis=-1)
        points = (
            np.stack([x, y], axis=-1)[:, None]
            + thrown[:, :1] * right[:, None]
            + thrown[:, 1:] * ahead[:, None]
        )
        hx, hy, hh, _ = HUMAN_PATH[step + 1]
        apart = points - (hx, hy)
        inside = (np.abs(apart @ [np.sin(hh), -np.cos(hh)]) < CAR_WIDTH / 2) & (
            np.abs(apart @ [np.cos(hh), np.sin(hh)]) < CAR_LENGTH / 2
        )
        hit |= inside.any(axis=1)
    assert 5 < hit.sum() < 195
    # Points thrown at random miss the slightest touches, the outline's points the thinnest ones.
    assert (collides(states) == hit).mean() > 0.97


def test_a_drive_is_on_the_road_as_long_as_its_middle_is():
    straight = DRIVING_V1.rollout(np.tile([0.0, 0.5], 5)[None])
    sideways = DRIVING_V1.rollout(np.tile([1.0, 1.0], 5)[None])
    assert stays_on_road(np.concatenate([straight, sideways])).tolist() == [True, False]
