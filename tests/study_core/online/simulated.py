"""Answers of somebody who likes one side of the road, which no hand-coded feature knows, to drives of the bank."""

from pathlib import Path

import numpy as np

from study_core.comparison import ComparisonSet
from study_core.online.feature import Compared
from study_core.study import parse_study

STUDY = parse_study((Path(__file__).parents[3] / "static" / "studies" / "online.toml").read_text())
WEIGHTS = np.array([0.3, 0.5, 0.4, 0.7])


def side(controls):
    """Returns the mean x of each drive."""
    return STUDY.domain.rollout(controls)[:, :, 0].mean(axis=1)


def answers(n, seed=0, liking=1.0, rationality=100.0):
    """Returns n answers; `liking` is the weight of the side."""
    rng = np.random.default_rng(seed)
    bank = STUDY.bank
    rows = rng.integers(len(bank.controls), size=(n, 2))
    psi = bank.features[rows[:, 0]] - bank.features[rows[:, 1]]
    sides = side(bank.controls)
    rewards = psi @ WEIGHTS + liking * (sides[rows[:, 0]] - sides[rows[:, 1]])
    likes_a = rng.random(n) < 1.0 / (1.0 + np.exp(-rationality * rewards))
    return Compared(ComparisonSet(psi, np.where(likes_a, 1.0, -1.0)), bank.controls[rows])
