"""The paper's hypotheses as tests.

H1: a learned feature beside the hand-coded ones predicts a person's answers better than the hand-coded ones alone.
H2: with learned features, different people's best trajectories differ more, and stay safe.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import stats


@dataclass(frozen=True)
class PairedTest:
    """Whether one predictor predicts the same people better than another.

    Attributes:
        n_people: How many were compared.
        n_better: For how many it is better.
        mean_gain: Mean difference of accuracies.
        effect_size: Cohen's d_z: mean over standard deviation of the differences; None if all are alike.
        p_wilcoxon: One-sided signed-rank test, exact where no two differences are alike; None if all are 0.
        p_t: One-sided paired t-test; None if all differences are alike.
    """

    n_people: int
    n_better: int
    mean_gain: float
    effect_size: float | None
    p_wilcoxon: float | None
    p_t: float | None


def paired_test(better: Mapping[str, float], worse: Mapping[str, float]) -> PairedTest:
    """Tests that `better` exceeds `worse`, person by person.

    Args:
        better: Accuracy by person of the predictor that is expected to be better.
        worse: Of the other one, for the same people.

    Raises:
        ValueError: The people differ, or there is but one.
    """
    if better.keys() != worse.keys() or len(better) < 2:
        raise ValueError(
            "Expected the same two or more people in both. Compare predictors of one evaluation."
        )
    gains = np.array([better[name] - worse[name] for name in better])
    spread = float(gains.std(ddof=1))
    varies = spread > 1e-12
    return PairedTest(
        n_people=len(gains),
        n_better=int((gains > 0.0).sum()),
        mean_gain=float(gains.mean()),
        effect_size=float(gains.mean()) / spread if varies else None,
        p_wilcoxon=float(stats.wilcoxon(gains, alternative="greater").pvalue) if gains.any() else None,
        p_t=float(stats.ttest_1samp(gains, 0.0, alternative="greater").pvalue) if varies else None,
    )
