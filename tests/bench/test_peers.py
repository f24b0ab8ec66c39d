"""Every sampler that ours is compared with draws from the one target, and where it can't be, says how to install it."""

import importlib

import numpy as np
import pytest

from app.bench.peers import INSTALL, installed_peers, target
from tests.study_core import references

LIBRARIES = ("emcee", "numpyro", "blackjax")


@pytest.fixture(scope="module")
def preferred_diffs():
    """Few answers, so that the posterior reaches the edges of the prior."""
    rng = np.random.default_rng(31)
    diffs = rng.normal(0.0, 0.01, (12, 4))
    return diffs * np.where(diffs @ np.array([0.05, 0.3, 0.8, 0.5]) > 0.0, 1.0, -1.0)[:, None]


@pytest.fixture(scope="module")
def truth(preferred_diffs):
    """Mean and mean square of each weight, by weighted draws from the prior."""
    points = references.prior_draws(np.random.default_rng(32), "sphere", 400_000)
    utilities = points @ preferred_diffs.T
    importance = np.exp(references.log_answer_probability("sigmoid", 200.0, 0.1, utilities).sum(axis=1))
    return importance @ np.hstack([points, points**2]) / importance.sum()


def test_the_target_has_the_likelihood_of_the_sigmoid_with_lapses(preferred_diffs):
    weights = references.prior_draws(np.random.default_rng(33), "sphere", 20)
    expected = references.log_answer_probability("sigmoid", 200.0, 0.1, weights @ preferred_diffs.T)
    np.testing.assert_allclose(
        target.log_likelihood(weights, preferred_diffs), expected.sum(axis=1), rtol=1e-12
    )


def test_starts_lie_in_the_prior_and_differ(preferred_diffs):
    starts = target.draw_starts(np.random.default_rng(34), preferred_diffs, 64)
    assert starts.min() >= 0.0
    np.testing.assert_allclose(np.linalg.norm(starts, axis=1), 1.0, rtol=1e-12)
    assert len({tuple(start) for start in starts}) == 64


def test_a_library_that_is_not_there_is_named(monkeypatch):
    def nothing(name):
        raise ModuleNotFoundError(name=name.rpartition(".")[2].partition("_")[0])

    monkeypatch.setattr("app.bench.peers.import_module", nothing)
    assert installed_peers() == ([], list(LIBRARIES))
    assert "[bench]" in INSTALL


@pytest.mark.slow
@pytest.mark.statistical
@pytest.mark.parametrize("library", LIBRARIES)
def test_a_peer_draws_from_the_target(library, preferred_diffs, truth):
    if importlib.util.find_spec(library) is None:
        pytest.skip(f"{library} is not installed: {INSTALL}")
    (peer,) = (peer for peer in installed_peers()[0] if peer.name == library)
    runs = [peer.draw(seed, preferred_diffs) for seed in range(6)]
    assert runs[0].shape[2] == 4
    np.testing.assert_allclose(np.linalg.norm(runs[0], axis=-1), 1.0, rtol=1e-9)
    found = np.array([np.concatenate([draws, draws**2], axis=-1).mean(axis=(0, 1)) for draws in runs])
    error = found.std(axis=0, ddof=1) / np.sqrt(len(found)) + 1e-3
    assert (np.abs(found.mean(axis=0) - truth) < 5.0 * error).all()
