"""`driving-v1`: the robot car of Katz et al. (2021), after Sadigh et al. (2017).

Data sheet:

| state | unit | meaning |
| --- | --- | --- |
| x | road widths of about 0.5 | across the road, right positive; lane centres -0.17, 0, 0.17; edges +-0.255 |
| y | same | along the road |
| theta | rad | heading; pi/2 is straight ahead, larger is left |
| v | units/s | speed, negative is backwards |

| control | range | meaning |
| --- | --- | --- |
| steer, 5 blocks | [-1, 1] | turn per unit of distance, left positive |
| gas, 5 blocks | [-1, 1] | speed that v approaches with a time constant of 1 s |

| feature | range | meaning; each the mean over the 50 recorded states, higher is better |
| --- | --- | --- |
| lane | (0, 1] | exp(-30 distance to the nearest lane centre squared) |
| speed | [-4, 0] | -(v - 1)^2 |
| heading | [-1, 1] | sin(theta) |
| collision | [-1, 0) | -exp(-(7 (x - x_h)^2 + 3 (y - y_h)^2)) |

The rich features, these four among them, have a sheet of their own in `rich_features`.

| network input | range | meaning, at each step |
| --- | --- | --- |
| x, heading, speed | | of the state |
| distance | [0, inf) | to the human car's centre |
| time_gap | [-5, 5] s | (y - y_h) / (v - v_h), damped near equal speeds; above 0 the cars part, below they approach |

The first four are the paper's; it tried the fifth as well.

Start: robot [0, -0.3, pi/2, 0.4]; the human car starts right and changes to the middle lane, in every drive alike.
Horizon: 50 steps of 0.1 s; the recorded states are those after each step. Version history: v1, as published;
the time gap came later and changed no number of what was there.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from study_core.domains.driving import features, kernels, rich_features
from study_core.domains.driving.cars import HUMAN_CAR, ROBOT_CAR
from study_core.domains.driving.dynamics import DT_S, HUMAN_PATH, N_BLOCKS, ROBOT_START, simulate
from study_core.domains.driving.ground import BACKGROUND, ground
from study_core.scene import Body, Bounds, Scene, Track


class Driving:
    """The contract of `study_core.domain.Domain` for `driving-v1`."""

    id = "driving-v1"
    feature_names = features.FEATURE_NAMES
    feature_labels = features.FEATURE_LABELS
    rich_feature_names = rich_features.RICH_FEATURE_NAMES
    network_input_names = features.NETWORK_INPUT_NAMES
    control_lower = np.full(2 * N_BLOCKS, -1.0)
    control_upper = np.full(2 * N_BLOCKS, 1.0)

    def rollout(self, controls: Float[np.ndarray, "n 10"]) -> Float[np.ndarray, "n 50 4"]:
        """Returns [x, y, theta, v] after each step."""
        return simulate(ROBOT_START, controls)[:, 1:]

    def features(self, states: Float[np.ndarray, "n 50 4"]) -> Float[np.ndarray, "n 4"]:
        """Returns lane, speed, heading and collision."""
        return features.features(states)

    def rich_features(self, states: Float[np.ndarray, "n 50 4"]) -> Float[np.ndarray, "n 54"]:
        """Returns 54 features of a whole drive."""
        return rich_features.rich_features(states)

    def network_inputs(self, states: Float[np.ndarray, "n 50 4"]) -> Float[np.ndarray, "n 50 5"]:
        """Returns [x, d, theta, v, time gap] at each step."""
        return features.network_inputs(states)

    def reward_and_gradient(
        self, controls: Float[np.ndarray, "n 10"], weights: Float[np.ndarray, "n 4"]
    ) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n 10"]]:
        """Returns w . Phi of each drive and its gradient in the controls."""
        rewards, gradients = kernels.rewards_and_gradients(
            np.ascontiguousarray(controls), np.ascontiguousarray(weights)
        )
        return rewards, gradients

    def scene(self, controls: Float[np.ndarray, " 10"]) -> Scene:
        """Returns both cars on the road, from the start on."""
        robot_path = simulate(ROBOT_START, controls[None])[0]
        tracks = (_track(ROBOT_CAR, robot_path), _track(HUMAN_CAR, HUMAN_PATH))
        bounds = _bounds(robot_path).union(_bounds(HUMAN_PATH)).union(_ROAD)
        return Scene(tracks, ground(bounds), DT_S, bounds, BACKGROUND)


# Half a car's diagonal: whatever its heading, it stays in the picture.
_CAR_RADIUS = 0.14
_ROAD = Bounds(-features.ROAD_EDGE, features.ROAD_EDGE, 0.0, 0.0)


def _track(body: Body, path: Float[np.ndarray, "51 4"]) -> Track:
    """Returns the body on its path; a car's own front is straight ahead, theta = pi/2."""
    positions = np.column_stack([path[:, :2], np.zeros(len(path))])
    return Track(body, positions, path[:, 2] - np.pi / 2)


def _bounds(path: Float[np.ndarray, "51 4"]) -> Bounds:
    x, y = path[:, 0], path[:, 1]
    return Bounds(
        float(x.min()) - _CAR_RADIUS,
        float(x.max()) + _CAR_RADIUS,
        float(y.min()) - _CAR_RADIUS,
        float(y.max()) + _CAR_RADIUS,
    )


DRIVING_V1 = Driving()
