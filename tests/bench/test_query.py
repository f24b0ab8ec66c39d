import json

import pytest
from rich.progress import Progress

from app.bench import query
from app.bench.report import BenchError


def test_a_small_run_finds_both_ways_in_agreement_and_the_plain_way_slower():
    result = query.run(3, Progress(disable=True), n_people=2, n_plain=1, n_answers=10)
    assert result["ratio_to_plain"] > 1.0
    assert result["agreement"]["posterior_means_agree"]
    assert result["agreement"]["best_reward_ours_minus_plain"]["smallest"] > -0.05
    ours = result["milliseconds"]
    parts = ("posterior", "pair_and_trajectories", "clips")
    for times in (ours, result["recommended_milliseconds"]):
        assert all(0.0 < times[part]["p10"] <= times[part]["median"] <= times[part]["p90"] for part in parts)
    assert set(ours["plain"]) == {"next_query", *parts}
    informative = result["information_gain"]
    assert set(informative["ratios"]) == {
        "aprel_looped_40",
        "aprel_looped_100",
        "aprel_vectorised_40",
        "aprel_vectorised_100",
    }
    assert 1.0 < informative["ratios"]["aprel_looped_40"] < informative["ratios"]["aprel_looped_100"]
    gains = informative["gain_bits"]
    assert gains["aprel_looped_40"] == gains["aprel_vectorised_40"]
    # Ours screens a random part of the bank's pairs, so all pairs of a lucky few drives may hold a slightly better one.
    assert gains["prefstudy"] > 0.9 * gains["aprel_looped_100"] > 0.0
    json.dumps(result)


def test_more_plain_repetitions_than_people_are_refused():
    with pytest.raises(BenchError, match=r"Expected 1 to 2 plain repetitions, got 3\."):
        query.run(3, Progress(disable=True), n_people=2, n_plain=3)
