import importlib
import io
import json

import pytest
from rich.console import Console
from rich.progress import Progress

from app.bench import posterior
from app.bench.peers import INSTALL
from app.bench.report import BenchError


def small_run(out=None, said=None):
    progress = Progress(console=Console(file=said or io.StringIO()), disable=True)
    return posterior.run(3, progress, out, n_people=1, n_runs=1, n_updates=1)


def test_without_the_peers_ours_is_measured_beside_aprel_and_the_way_to_install_them_is_told(
    monkeypatch,
):
    monkeypatch.setattr(posterior, "installed_peers", lambda: ([], ["emcee", "numpyro", "blackjax"]))
    said = io.StringIO()
    result = small_run(said=said)
    assert INSTALL in said.getvalue()
    assert set(result["ess_per_second"]) == {"prefstudy"}
    assert result["ratio_to_best_peer"] is None
    assert set(result["update_milliseconds"]) == set(result["update_ess"]) == {"10", "100", "1000"}
    assert result["ratio_to_aprel_looped"] > result["ratio_to_aprel_vectorised"] > 0.0
    assert result["samplers"]["prefstudy"]["ess"] > 100.0
    assert {"versions", "cores", "seed"} <= set(result)
    json.dumps(result)


def test_a_folder_that_exists_is_refused_before_anything_is_measured(tmp_path):
    with pytest.raises(BenchError, match="Name a new one"):
        small_run(tmp_path)


@pytest.mark.slow
def test_all_samplers_agree_and_the_cost_of_an_update_is_drawn(tmp_path):
    for library in ("blackjax", "emcee", "matplotlib", "numpyro"):
        if importlib.util.find_spec(library) is None:
            pytest.skip(f"{library} is not installed: {INSTALL}")
    result = small_run(tmp_path / "out")
    assert set(result["ess_per_second"]) == {"prefstudy", "emcee", "numpyro", "blackjax"}
    assert result["agreement"]["means_agree"], result["agreement"]
    assert len(result["update_milliseconds_curve"]) == len(posterior.CURVE_AT)
    assert (tmp_path / "out" / "update-cost.png").stat().st_size > 5000
