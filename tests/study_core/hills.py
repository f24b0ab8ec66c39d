"""A made-up domain whose best drives are known: a box slides to a point of a map with one hill for each feature."""

import numpy as np

from study_core.scene import Body, Bounds, Mesh, Scene, Track

CENTRES = np.array([[-0.6, -0.6], [0.7, -0.2], [-0.1, 0.8]])
WIDTH = 0.3
BOX_LENGTH = 2.0
N_FRAMES = 5
REACH = 10.0

_BOX = Body(
    "box",
    (Mesh(np.array([[0.0, -1.0, 0.0], [0.5, 1.0, 0.0], [0.0, 1.0, 0.5]]), np.array([[0, 1, 2]]), "#112233"),),
)


class HillsDomain:
    """Feature k is exp(-|c - centre_k|^2 / WIDTH^2) in the two controls c; the hills stand far apart."""

    id = "hills-v1"
    feature_names = ("south-west", "east", "north")
    feature_labels = feature_names
    rich_feature_names = (*feature_names, "x", "y")
    network_input_names = ("x",)
    control_lower = np.array([-1.0, -1.0])
    control_upper = np.array([1.0, 1.0])

    def __init__(self, centres=CENTRES):
        self.centres = np.array(centres)

    def rollout(self, controls):
        return controls[:, None, :].copy()

    def features(self, states):
        offsets = states[:, 0, None, :] - self.centres
        return np.exp(-(offsets**2).sum(axis=-1) / WIDTH**2)

    def rich_features(self, states):
        return np.column_stack([self.features(states), states[:, 0]])

    def network_inputs(self, states):
        return states[:, :, :1].copy()

    def reward_and_gradient(self, controls, weights):
        offsets = controls[:, None, :] - self.centres
        heights = weights * np.exp(-(offsets**2).sum(axis=-1) / WIDTH**2)
        return heights.sum(axis=1), (-2.0 / WIDTH**2 * heights[:, :, None] * offsets).sum(axis=1)

    def scene(self, controls):
        way = np.linspace(0.0, REACH, N_FRAMES)[:, None] * [*controls, 0.0]
        track = Track(_BOX, way, np.zeros(N_FRAMES))
        return Scene((track,), (), 0.1, Bounds(-11.0, 11.0, -11.0, 11.0), "#ffffff")
