import json

import pytest
from rich.progress import Progress

from app.bench import trajectories
from app.bench.report import BenchError


def test_a_small_run_finds_the_bank_at_least_as_good_as_many_starts():
    result = trajectories.run(3, Progress(disable=True), n_weights=10, n_reference_starts=200)
    assert result["share_at_least_as_good"] == 1.0
    assert result["share_at_least_as_good_of_10_starts"] < 1.0
    assert result["share_converged"] == 1.0
    assert result["largest_shortfall"]["bank"] < 1e-3 < result["largest_shortfall"]["10_starts"]
    assert set(result["ratio_to_10_starts"]) == {"one_by_one", "at_once"}
    assert result["bank"]["drives"] < result["bank"]["climbs"]
    json.dumps(result)


def test_fewer_starts_than_those_of_the_paper_are_no_reference():
    with pytest.raises(BenchError, match=r"Expected at least 1 weight vector and 10 starts, got 5 and 9\."):
        trajectories.run(3, Progress(disable=True), n_weights=5, n_reference_starts=9)


@pytest.mark.slow
def test_the_bank_is_as_good_as_a_thousand_starts_for_99_of_100_weights():
    result = trajectories.run(4, Progress(disable=True))
    assert result["share_at_least_as_good"] >= 0.99
    assert result["share_within_a_thousandth_of_the_reward"] >= 0.99
    assert 0.4 < result["share_at_least_as_good_of_10_starts"] < 0.85
