"""Both ways of training end in the same losses, and the numbers are there."""

import json

from rich.progress import Progress

from app.bench import training
from study_core.networks.config import NetworkConfig


def test_a_small_run_agrees_with_torch_and_says_where_it_was_measured(monkeypatch):
    monkeypatch.setattr(training, "_N_TURNS", 1)
    config = NetworkConfig(n_trials=5, n_epochs=22)
    result = training.run(3, Progress(disable=True), n_people=2, config=config)
    assert result["losses_agree"]
    assert 0.0 < result["largest_loss_difference"] < 1e-3
    assert result["ratio_to_sequential"] > 0.0
    assert result["study_seconds"] > 0.0
    assert (result["people"], result["trials"], result["epochs"]) == (2, 5, 22)
    assert {"versions", "cores", "cpu", "seed"} <= set(result)
    json.dumps(result)
