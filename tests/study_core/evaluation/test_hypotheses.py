from itertools import product

import numpy as np
import pytest

from study_core.evaluation.hypotheses import paired_test


def people(values):
    return {str(number): value for number, value in enumerate(values)}


def test_the_signed_rank_test_counts_all_sign_patterns():
    gains = np.array([0.03, -0.01, 0.05, 0.08, 0.02, 0.11])
    found = paired_test(people(0.6 + gains), people(np.full(6, 0.6)))
    ranks = np.argsort(np.argsort(np.abs(gains))) + 1
    seen = ranks[gains > 0].sum()
    sums = [
        sum(rank for rank, is_gain in zip(ranks, signs, strict=True) if is_gain)
        for signs in product([0, 1], repeat=6)
    ]
    assert found.p_wilcoxon == pytest.approx(np.mean([total >= seen for total in sums]))
    assert (found.n_people, found.n_better) == (6, 5)
    assert found.mean_gain == pytest.approx(gains.mean())
    assert found.effect_size == pytest.approx(gains.mean() / gains.std(ddof=1))


@pytest.mark.statistical
def test_the_t_test_is_what_random_signs_say():
    rng = np.random.default_rng(5)
    gains = rng.normal(0.02, 0.05, 15)
    found = paired_test(people(0.6 + gains), people(np.full(15, 0.6)))
    flipped = rng.choice([-1.0, 1.0], (100_000, 15)) * gains
    assert found.p_t == pytest.approx((flipped.mean(axis=1) >= gains.mean()).mean(), abs=0.02)


def test_the_same_predictor_twice_proves_nothing():
    found = paired_test(people([0.6, 0.7]), people([0.6, 0.7]))
    assert (found.effect_size, found.p_wilcoxon, found.p_t, found.n_better) == (None, None, None, 0)


def test_other_people_are_refused():
    with pytest.raises(ValueError, match="same two or more people"):
        paired_test({"1": 0.5, "2": 0.6}, {"1": 0.5, "3": 0.6})
