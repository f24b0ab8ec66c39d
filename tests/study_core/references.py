"""Slow references from the equations alone, and toy domains with known answers. Nothing here calls the product."""

import math

import numpy as np
import torch

from study_core.scene import Body, Bounds, Mesh, Scene, Track

ROBOT_START = (0.0, -0.3, math.pi / 2, 0.4)
HUMAN_START = (0.17, 0.0, math.pi / 2, 0.41)
HUMAN_CONTROLS = (0, 0.41, 1, 0.41, -1, 0.41, 0, 0.533, 0, 0.533)


def drive(start, controls, sin=math.sin, cos=math.cos):
    """Returns the 50 states after each step, all four updated from the old state."""
    x, y, theta, v = start
    states = []
    for block in range(5):
        steer, gas = controls[2 * block], controls[2 * block + 1]
        for _ in range(10):
            x, y, theta, v = (
                x + 0.1 * v * cos(theta),
                y + 0.1 * v * sin(theta),
                theta + 0.1 * v * steer,
                v + 0.1 * (gas - v),
            )
            states.append((x, y, theta, v))
    return states


HUMAN_STATES = drive(HUMAN_START, HUMAN_CONTROLS)


def features(states):
    """Returns lane, speed, heading and collision, averaged over the 50 states."""
    lane, speed, heading, collision = [], [], [], []
    for (x, y, theta, v), (x_h, y_h, _, _) in zip(states, HUMAN_STATES, strict=True):
        lane.append(math.exp(-30.0 * min((x - centre) ** 2 for centre in (-0.17, 0.0, 0.17))))
        speed.append(-((v - 1.0) ** 2))
        heading.append(math.sin(theta))
        collision.append(-math.exp(-(7.0 * (x - x_h) ** 2 + 3.0 * (y - y_h) ** 2)))
    return [math.fsum(values) / 50.0 for values in (lane, speed, heading, collision)]


def torch_reward(controls, weights):
    """Returns w . Phi of one drive as a tensor that autograd can differentiate."""
    start = [torch.tensor(value, dtype=torch.float64) for value in ROBOT_START]
    total = torch.tensor(0.0, dtype=torch.float64)
    for (x, y, theta, v), (x_h, y_h, _, _) in zip(
        drive(start, controls, torch.sin, torch.cos), HUMAN_STATES, strict=True
    ):
        nearest = torch.stack([(x - centre) ** 2 for centre in (-0.17, 0.0, 0.17)]).min()
        total = total + weights[0] * torch.exp(-30.0 * nearest) - weights[1] * (v - 1.0) ** 2
        total = total + weights[2] * torch.sin(theta)
        total = total - weights[3] * torch.exp(-(7.0 * (x - x_h) ** 2 + 3.0 * (y - y_h) ** 2))
    return total / 50.0


def log_sigmoid(u):
    """Returns log(1 / (1 + e^-u)) without overflow."""
    return np.where(u >= 0, -np.log1p(np.exp(-np.abs(u))), u - np.log1p(np.exp(-np.abs(u))))


def log_answer_probability(model, rationality, lapse_rate, preferred_reward_diffs):
    """Returns log p of each answer from beta (R_preferred - R_other)."""
    u = rationality * preferred_reward_diffs
    if model == "clipped-linear":
        return np.minimum(u, 0.0)
    if lapse_rate == 0.0:
        return log_sigmoid(u)
    return np.logaddexp(math.log(lapse_rate / 2.0), math.log1p(-lapse_rate) + log_sigmoid(u))


def log_likelihoods(feature_diffs, signs, weights, rationality, lapse_rate=0.0, tie_threshold=0.0):
    """Returns log p(all answers) of the sigmoid for each row: Rao and Kupper's three answers, lapses over them."""
    rationality, lapse_rate, tie_threshold = (
        np.broadcast_to(np.asarray(value, dtype=float), len(weights))[:, None]
        for value in (rationality, lapse_rate, tie_threshold)
    )
    utilities = rationality * (weights @ feature_diffs.T)
    with np.errstate(divide="ignore"):
        prefers = log_sigmoid(utilities * signs - tie_threshold)
        both = log_sigmoid(utilities - tie_threshold) + log_sigmoid(-utilities - tie_threshold)
        same = np.log(np.exp(2 * tie_threshold) - 1) + both
        lapsed = np.log(lapse_rate / np.where(tie_threshold > 0, 3.0, 2.0))
    chosen = np.where(signs == 0.0, same, prefers)
    return np.logaddexp(lapsed, np.log1p(-lapse_rate) + chosen).sum(axis=1)


def prior_draws(rng, support, n, d=4):
    """Returns uniform draws on the positive part of the unit ball, by rejection, or of the unit sphere."""
    kept = []
    while sum(map(len, kept)) < n:
        points = rng.random((2 * n, d))
        lengths = np.sqrt((points**2).sum(axis=1))
        inside = (lengths <= 1.0) & (lengths > 1e-6)
        kept.append(points[inside] / (lengths[inside, None] if support == "sphere" else 1.0))
    return np.concatenate(kept)[:n]


_BAR_CORNERS = np.array([[0.0, -0.5, 0.0], [0.1, 0.5, 0.0], [0.0, 0.5, 0.1]])
BAR = Body("bar", (Mesh(_BAR_CORNERS, np.array([[0, 1, 2]]), "#112233"),))


class QuadraticDomain:
    """One step whose state is its controls; feature k is -sum_c scales_c (controls_c - targets_kc)^2.

    With weights w the optimum is the weighted mean of the targets, clipped to the bounds.
    """

    id = "quadratic-v1"
    network_input_names = ("controls",)

    def __init__(self, targets, scales):
        self.targets, self.scales = np.array(targets, dtype=float), np.array(scales, dtype=float)
        self.feature_names = tuple(f"closeness {k}" for k in range(len(self.targets)))
        self.feature_labels = self.feature_names
        self.rich_feature_names = tuple(f"control {c}" for c in range(len(self.scales)))
        self.control_lower = np.full(len(self.scales), -1.0)
        self.control_upper = np.full(len(self.scales), 1.0)

    def best_controls(self, weights):
        return np.clip(weights @ self.targets / weights.sum(), self.control_lower, self.control_upper)

    def rollout(self, controls):
        return controls[:, None, :].copy()

    def features(self, states):
        return -(self.scales * (states[:, 0, None, :] - self.targets) ** 2).sum(axis=-1)

    def rich_features(self, states):
        return states[:, 0].copy()

    def network_inputs(self, states):
        return states[:, :, :1].copy()

    def reward_and_gradient(self, controls, weights):
        offsets = controls[:, None, :] - self.targets
        rewards = -(weights[:, :, None] * self.scales * offsets**2).sum(axis=(1, 2))
        return rewards, -2.0 * (weights[:, :, None] * self.scales * offsets).sum(axis=1)

    def scene(self, controls):
        """A bar of length 1 that slides from the origin to the first control's value."""
        track = Track(BAR, np.array([[0.0, 0.0, 0.0], [controls[0], 0.0, 0.0]]), np.zeros(2))
        return Scene((track,), (), 0.1, Bounds(-2.0, 2.0, -2.0, 2.0), "#ffffff")


class BangBangDomain(QuadraticDomain):
    """One control, whose best value is +1 or -1: features c and -c."""

    id = "bang-bang-v1"
    feature_names = ("forwards", "backwards")
    feature_labels = feature_names
    rich_feature_names = ("control",)
    network_input_names = ("control",)
    control_lower = np.array([-1.0])
    control_upper = np.array([1.0])

    def __init__(self):
        pass

    def features(self, states):
        return np.column_stack([states[:, 0, 0], -states[:, 0, 0]])

    def reward_and_gradient(self, controls, weights):
        slopes = weights[:, 0] - weights[:, 1]
        return slopes * controls[:, 0], slopes[:, None].copy()


class FirstEvaluation:
    """A domain that records the controls of the first call of `reward_and_gradient`."""

    def __init__(self, domain):
        self.domain, self.starts = domain, None

    def __getattr__(self, name):
        return getattr(self.domain, name)

    def reward_and_gradient(self, controls, weights):
        if self.starts is None:
            self.starts = controls.copy()
        return self.domain.reward_and_gradient(controls, weights)


def standard_error_of_weighted_mean(values, weights):
    """Returns the self-normalised importance estimate of each column, and its standard error."""
    shares = weights / weights.sum()
    means = shares @ values
    return means, np.sqrt((shares**2) @ (values - means) ** 2)


def study_text(**changes):
    """Returns a small valid study as TOML; `section__key=value` changes a line, `None` removes it."""
    tables = {
        "": {"name": "small", "title": "Small", "seed": 5, "domain": "driving-v1"},
        "text": {"welcome": "Hello", "question": "Which?", "thanks": "Thanks"},
        "protocol": {"active_queries": 3, "test_queries": 2},
        "response": {"model": "sigmoid", "rationality": 50.0, "lapse_rate": 0.1},
        "prior": {"support": "sphere"},
        "sampler": {"samples": 20, "chains": 4, "warmup": 200, "draws": 400, "most_draws": 400},
        "acquisition": {"method": "heuristic", "mu": 0.1},
        "trajectory": {"starts": 3},
    }
    for place, value in changes.items():
        section, _, key = place.rpartition("__")
        tables.setdefault(section, {})
        if value is None:
            del tables[section][key]
        else:
            tables[section][key] = value
    if tables["trajectory"].get("search") == "bank":
        tables["trajectory"].pop("starts", None)
    lines = []
    for section, keys in tables.items():
        lines += [f"[{section}]"] if section else []
        lines += [f"{key} = {_toml(value)}" for key, value in keys.items()]
    return "\n".join(lines) + "\n"


def _toml(value):
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"[{', '.join(_toml(entry) for entry in value)}]"
    return f'"{value}"' if isinstance(value, str) else str(value)
