"""What is said of the published study, on somebody made up."""

from dataclasses import replace

import pytest
from rich.progress import Progress

from app.bench import published
from study_core.evaluation import hand_coded
from study_core.posterior.run import SamplerSettings
from tests.study_core.evaluation.test_hand_coded import somebody


@pytest.fixture
def result(monkeypatch, tmp_path):
    few = SamplerSettings(n_chains=4, n_warmup=100, n_draws=300, most_draws=300, n_samples=200)
    monkeypatch.setattr(hand_coded, "SETTINGS", few)
    monkeypatch.setattr(published, "MODELS", {"beta 50": hand_coded.MODELS["beta 50"]})
    monkeypatch.setattr(
        published, "read_study", lambda directory: {3: somebody(), 5: replace(somebody(), number=5)}
    )
    with Progress(disable=True) as progress:
        return published.run(0, tmp_path, progress)


def test_each_model_stands_beside_the_stored_posterior_with_an_interval(result):
    assert result["people"] == [3, 5]
    assert list(result["models"]) == ["stored posterior", "beta 50"]
    assert result["models"]["stored posterior"]["test_accuracy"] == {"mean": 1.0, "interval": [1.0, 1.0]}
    found = result["models"]["beta 50"]
    low, high = found["test_accuracy"]["interval"]
    assert low <= found["test_accuracy"]["mean"] <= high
    assert found["gain_over_stored"]["mean"] == pytest.approx(found["test_accuracy"]["mean"] - 1.0, abs=1e-4)
    assert 0 <= found["converged"] <= 2


def test_it_says_where_and_with_what_it_was_measured(result):
    assert {"versions", "cores", "cpu", "seed"} <= set(result)
