"""Made-up drives."""

from __future__ import annotations

import numpy as np

from study_core.domains.driving.cars import HUMAN_CAR, ROBOT_CAR
from study_core.domains.driving.ground import BACKGROUND, ground
from study_core.scene import Bounds, Scene, Track

N_FRAMES = 51
DT_S = 0.1


def drive(sway: float = 0.2, length: float = 4.2, yaw_rad: float = 0.4) -> Scene:
    """A robot that sways to the right and back while a human drives straight on."""
    share = np.linspace(0.0, 1.0, N_FRAMES)
    nothing = np.zeros(N_FRAMES)
    robot = np.column_stack([sway * np.sin(np.pi * share), -0.3 + length * share, nothing])
    human = np.column_stack([nothing + 0.17, 2.2 * share, nothing])
    tracks = (
        Track(ROBOT_CAR, robot, yaw_rad * np.sin(7 * share)),
        Track(HUMAN_CAR, human, nothing),
    )
    x = np.concatenate([robot[:, 0], human[:, 0]])
    y = np.concatenate([robot[:, 1], human[:, 1]])
    bounds = Bounds(
        min(float(x.min()) - 0.14, -0.255),
        max(float(x.max()) + 0.14, 0.31),
        float(y.min()) - 0.14,
        float(y.max()) + 0.14,
    )
    return Scene(tracks, ground(bounds), DT_S, bounds, BACKGROUND)
