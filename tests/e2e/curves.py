"""Where the cars of a stored query must be seen, worked out from the query alone."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from app.stage.framing import Layout, frame, project
from study_core.comparison import Query
from tests.e2e.person import STUDY, Seen

# In units of half the picture's height; a lane is about 0.06 wide in a usual picture.
NEAR = 0.008


class Curve:
    """The way of one car over the picture, one point for each frame of its track."""

    def __init__(self, points: Float[np.ndarray, "n 2"]) -> None:
        self.points = points

    def distance(self, point: Float[np.ndarray, " 2"]) -> float:
        """Returns how far a point is from the curve."""
        return float(self._distances(point)[0].min())

    def moment(self, point: Float[np.ndarray, " 2"]) -> float:
        """Returns when the car is nearest to a point, from 0 at its start to 1 at its end."""
        distances, shares = self._distances(point)
        nearest = int(distances.argmin())
        return float(nearest + shares[nearest]) / (len(self.points) - 1)

    def _distances(
        self, point: Float[np.ndarray, " 2"]
    ) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, " m"]]:
        start, step = self.points[:-1], np.diff(self.points, axis=0)
        length = np.maximum((step**2).sum(axis=1), 1e-18)
        shares = np.clip(((point - start) * step).sum(axis=1) / length, 0.0, 1.0)
        return np.linalg.norm(start + shares[:, None] * step - point, axis=1), shares


def curves(query: Query, layout: Layout) -> tuple[Curve, Curve, Curve, Curve]:
    """Returns the curves of robot A, human A, robot B, human B."""
    a, b = STUDY.domain.scene(query.controls_a), STUDY.domain.scene(query.controls_b)
    framing = frame(a.bounds.union(b.bounds), layout)
    found = [
        Curve(project(placement.apply(track.positions), layout) * (layout.aspect, 1.0))
        for scene, placement in ((a, framing.a), (b, framing.b))
        for track in scene.tracks
    ]
    robot_a, human_a, robot_b, human_b = found
    return robot_a, human_a, robot_b, human_b


def in_picture(seen: list[Seen], layout: Layout) -> Float[np.ndarray, "n 4 2"]:
    """Returns where the cars were seen, in the units of the curves."""
    return np.array(seen).reshape(-1, 4, 2) * (layout.aspect, 1.0)


def moments(seen: list[Seen], query: Query, layout: Layout = Layout.WIDE) -> Float[np.ndarray, " n"]:
    """Returns when in the drive each frame is, by the human's car on side A, which always moves."""
    human = curves(query, layout)[1]
    return np.array([human.moment(point) for point in in_picture(seen, layout)[:, 1]])


def assert_on_stage(seen: list[Seen], query: Query, layout: Layout = Layout.WIDE) -> None:
    """Checks that every car was seen on its own curve and nowhere else."""
    points = in_picture(seen, layout)
    for car, curve in enumerate(curves(query, layout)):
        away = max(curve.distance(point) for point in points[:, car])
        assert away < NEAR, f"car {car} was seen {away:.4f} away from its curve"
