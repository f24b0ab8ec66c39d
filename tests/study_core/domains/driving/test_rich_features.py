"""Rich features against their table, written once more as loops, and against drives one can picture."""

import math
import statistics
from itertools import pairwise

import numpy as np
import pytest

from study_core.domains.driving import DRIVING_V1, rich_features
from tests.study_core import references

NAMES = DRIVING_V1.rich_feature_names
HUMAN = references.drive(references.HUMAN_START, references.HUMAN_CONTROLS)
LANES = {"left": -0.17, "middle": 0.0, "right": 0.17}


def s(z):
    return 1.0 / (1.0 + math.exp(-z))


def bump(z):
    return math.exp(-z * z / 2)


def changes(values):
    return [after - before for before, after in pairwise(values)]


def expected(states):
    """Every feature of one drive, by name, from the table."""
    mean = statistics.fmean
    x, y, theta, v = (list(column) for column in np.transpose(states))
    dx = [a - b[0] for a, b in zip(x, HUMAN, strict=True)]
    dy = [a - b[1] for a, b in zip(y, HUMAN, strict=True)]
    both = list(zip(dx, dy, strict=True))
    d = [math.hypot(*offset) for offset in both]
    same = [bump(a / 0.085) for a in dx]
    turn = [min(abs(a - math.pi / 2), 1.6) for a in theta]
    off = [min(abs(a - centre) for centre in LANES.values()) for a in x]
    nearest = [min(LANES, key=lambda lane, a=a: abs(a - LANES[lane])) for a in x]
    side = [max(-0.4, min(0.4, a)) for a in x]
    acceleration = [a / 0.1 for a in changes(v)]
    steering = [a / 0.1 for a in changes(theta)]
    close = [math.exp(-(7 * a**2 + 3 * b**2)) for a, b in both]
    touching = [math.exp(-((a / 0.1) ** 2 + (b / 0.2) ** 2) / 2) for a, b in both]

    def with_same(kernel):
        return mean(share * kernel(b) for share, b in zip(same, dy, strict=True))

    return {
        **dict(zip(DRIVING_V1.feature_names, references.features(states), strict=True)),
        "off road": mean(s((abs(a) - 0.255) / 0.02) for a in x),
        "beyond lanes": mean(max(abs(a) - 0.2, 0) for a in x),
        "farthest beyond lanes": math.tanh(max(max(abs(a) - 0.2, 0) for a in x) / 0.2),
        "off road at end": s((abs(x[-1]) - 0.255) / 0.02),
        "farthest from middle": math.tanh(max(abs(a) for a in x) / 0.3),
        "closest": max(close),
        "touching": max(touching),
        "longest touching": mean(touching),
        "least distance": min(min(d), 0.5),
        "near": mean(s((0.2 - a) / 0.03) for a in d),
        "distance at end": min(d[-1], 1),
        "way": y[-1],
        "way beyond usual": max(y[-1] - 1.5, 0),
        "farthest": max(y),
        "mean speed": mean(v),
        "final speed": v[-1],
        "least speed": min(v),
        "greatest speed": max(v),
        "speed variation": statistics.pstdev(v),
        "backing up": 10 * mean(max(-a, 0) for a in v),
        "standing or backing": mean(s((0.15 - a) / 0.03) for a in v),
        "slow": mean(max(0.4 - a, 0) for a in v),
        "unlike traffic": mean(abs(a - b[3]) for a, b in zip(v, HUMAN, strict=True)),
        "largest turn": max(turn),
        "mean turn": mean(turn),
        "final turn": turn[-1],
        "turning": min(sum(map(abs, changes(theta))), 3),
        "off centre": mean(min(a, 0.3) for a in off),
        "off centre at end": min(off[-1], 0.3),
        "side at end": side[-1],
        "side": mean(side),
        "swaying": min(sum(map(abs, changes(x))), 1),
        "lane changes": sum(a != b for a, b in pairwise(nearest)),
        **{f"in {lane} lane": mean(bump((a - at) / 0.06) for a in x) for lane, at in LANES.items()},
        "in middle lane at end": bump(x[-1] / 0.06),
        "ahead": mean(s(b / 0.1) for b in dy),
        "ahead at end": s(dy[-1] / 0.1),
        "behind in its lane": with_same(lambda b: s(-b / 0.1)),
        "ahead in its lane": with_same(lambda b: s(b / 0.1)),
        "tailing": with_same(lambda b: bump((b + 0.3) / 0.15)),
        "cutting in": with_same(lambda b: bump((b - 0.3) / 0.15)),
        "beside": mean((1 - share) * bump(b / 0.2) for share, b in zip(same, dy, strict=True)),
        "acceleration": mean(map(abs, acceleration)),
        "braking": mean(max(-a, 0) for a in acceleration),
        "hardest acceleration": max(map(abs, acceleration)),
        "jerk": mean(abs(a) / 0.1 for a in changes(acceleration)),
        "steering": mean(min(abs(a), 2) for a in steering),
        "steering changes": mean(min(abs(a), 2) for a in changes(steering)),
    }


def of(controls):
    """Features of one drive, by name."""
    states = DRIVING_V1.rollout(np.asarray(controls, dtype=float)[None])
    return dict(zip(NAMES, DRIVING_V1.rich_features(states)[0], strict=True))


def test_every_feature_is_what_the_table_says():
    rng = np.random.default_rng(8)
    controls = np.vstack([rng.uniform(-1.0, 1.0, (30, 10)), rng.choice([-1.0, 1.0], (30, 10))])
    found = DRIVING_V1.rich_features(DRIVING_V1.rollout(controls))
    for row, values in zip(controls, found, strict=True):
        wanted = expected(references.drive(references.ROBOT_START, row))
        assert tuple(wanted) == NAMES
        np.testing.assert_allclose(values, list(wanted.values()), rtol=1e-6, atol=1e-7)


def sheet():
    """The ranges of the docstring's table, by name."""
    ranges = {}
    for line in rich_features.__doc__.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 4 and cells[2][0] in "([":
            low, high = (float(number) for number in cells[2].strip("()[]").split(", "))
            ranges |= dict.fromkeys(cells[1].split(", "), (low, high))
    return ranges


def test_they_stay_in_the_ranges_of_the_data_sheet():
    controls = np.random.default_rng(9).choice([-1.0, 0.0, 1.0], (3000, 10))
    rich = dict(zip(NAMES, DRIVING_V1.rich_features(DRIVING_V1.rollout(controls)).T, strict=True))
    ranges = sheet()
    assert set(ranges) == set(NAMES)
    for name, (low, high) in ranges.items():
        assert low <= rich[name].min(), name
        assert rich[name].max() <= high, name


@pytest.mark.parametrize(
    "name", ["off road", "off road at end", "turning", "swaying", "lane changes", "steering"]
)
def test_going_straight_in_the_middle_does_nothing_of_this(name):
    assert of([0.0, 0.5] * 5)[name] == pytest.approx(0.0, abs=1e-5)


def test_backing_up_standing_and_going_are_told_apart():
    backwards, standing, going = of([0.0, -1.0] * 5), of([0.0, 0.0] * 5), of([0.0, 1.0] * 5)
    assert backwards["backing up"] > 3.0
    assert standing["backing up"] == going["backing up"] == 0.0
    assert standing["standing or backing"] > 0.7
    assert going["standing or backing"] < 0.01
    assert backwards["way"] < -2.0 < standing["way"] < 1.0 < going["way"]


def test_a_mirrored_road_turns_the_sides_around():
    """Steering the other way; what concerns the other car isn't symmetric."""
    rng = np.random.default_rng(3)
    controls = rng.uniform(-1.0, 1.0, 10)
    mirrored = controls * np.tile([-1.0, 1.0], 5)
    one, other = of(controls), of(mirrored)
    assert one["side"] == pytest.approx(-other["side"])
    assert one["in left lane"] == pytest.approx(other["in right lane"])
    for name in ("off road", "off centre", "turning", "steering changes", "jerk", "lane changes", "way"):
        assert one[name] == pytest.approx(other[name], abs=1e-9), name
