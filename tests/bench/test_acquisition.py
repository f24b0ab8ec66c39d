"""The method comparison: the same people for all, honest summaries, a picture with every method in it."""

import json
from itertools import pairwise

import numpy as np
import pytest
from rich.progress import Progress

from app.bench import acquisition
from app.bench.acquisition import MEASURES, Task, study_for, walk
from app.bench.acquisition_figure import draw
from app.bench.curve import over_people
from app.bench.report import BenchError
from app.settings import find_study
from study_core.acquisition import METHODS


@pytest.fixture(scope="module")
def short_walk():
    return walk(Task("information-gain-realistic", number=1, seed=3, n_queries=6))


def test_a_walk_is_measured_before_the_first_answer_and_after_each(short_walk):
    assert short_walk.measures.shape == (len(MEASURES), 7)
    alignment, regret, accuracy = short_walk.measures
    assert ((alignment > 0.0) & (alignment <= 1.0)).all()
    assert (regret >= 0.0).all()
    assert ((accuracy >= 0.0) & (accuracy <= 1.0)).all()
    assert (short_walk.milliseconds > 0.0).all()
    assert short_walk.is_methods_own.all()


def test_a_walk_is_the_same_wherever_it_is_run(short_walk):
    np.testing.assert_array_equal(walk(short_walk.task).measures, short_walk.measures)


def test_each_method_is_taught_by_the_same_people(short_walk):
    """Before the first answer nothing is known but the prior, and the truth is the same."""
    other = walk(Task("random", number=1, seed=3, n_queries=1))
    np.testing.assert_array_equal(other.measures[:, 0], short_walk.measures[:, 0])


def test_every_method_is_compared_with_the_same_response_and_prior_and_the_heuristic_runs_as_in_the_paper():
    quickstart, katz2021 = find_study("quickstart"), find_study("katz2021")
    for method in METHODS:
        study = study_for(method)
        assert study.file.acquisition.method == method
        assert (study.response, study.prior) == (quickstart.response, quickstart.prior)
    assert study_for("heuristic").file.acquisition == katz2021.file.acquisition
    assert study_for("heuristic").file.trajectory == katz2021.file.trajectory
    assert study_for("regret").file.trajectory.search == "bank"


def test_a_small_run_reports_every_method_and_draws_it(tmp_path):
    methods = ("information-gain-realistic", "random")
    out = tmp_path / "out"
    result = acquisition.run(3, Progress(disable=True), 2, 2, out, methods)
    assert (result["people"], result["queries"], set(result["methods"])) == (2, 2, set(methods))
    for summary in result["methods"].values():
        assert summary["alignment_at_20"] is None
        assert summary["queries_to_0.98"] is None
        assert summary["share_from_prior"] == 0.0
    written = json.loads((out / "acquisition.json").read_text())
    assert {name: value for name, value in written.items() if name != "curves"} == result
    assert len(written["curves"]["random"]["alignment"]["mean"]) == 3
    assert (out / "acquisition.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(BenchError, match="Name a new one"):
        acquisition.run(3, Progress(disable=True), 2, 2, out, methods)


def test_one_person_is_refused():
    with pytest.raises(BenchError, match="Expected at least 2 people, got 1"):
        acquisition.run(3, Progress(disable=True), 1)


def test_the_first_query_that_reaches_a_level_is_counted_in_answers():
    curves = {name: over_people(np.array([[0.5, 0.9, 0.99], [0.5, 0.9, 0.99]])) for name in MEASURES}
    summary = acquisition._summary(curves, [walk(Task("random", 1, 3, 1))])
    assert (summary["queries_to_0.95"], summary["queries_to_0.98"]) == (2, 2)


@pytest.mark.statistical
def test_the_interval_is_that_of_the_mean():
    values = np.random.default_rng(0).normal(size=(200, 300))
    curve = over_people(values)
    np.testing.assert_allclose(curve.mean, values.mean(axis=0), atol=1e-14)
    is_covered = (curve.low <= 0.0) & (curve.high >= 0.0)
    assert 0.90 < is_covered.mean() < 0.99
    half_width = (curve.high - curve.low).mean() / 2.0
    assert half_width == pytest.approx(1.96 / 200**0.5, rel=0.05)


def test_every_method_is_named_once_beside_each_measure_and_no_names_overlap():
    rng = np.random.default_rng(1)
    curves = {
        method: {name: over_people(rng.uniform(0.9, 0.91, (5, 9))) for name in MEASURES} for method in METHODS
    }
    figure = draw(curves)
    figure.draw_without_rendering()
    for axes in figure.axes:
        assert sorted(text.get_text() for text in axes.texts) == sorted(METHODS)
        boxes = sorted((text.get_window_extent() for text in axes.texts), key=lambda box: box.y0)
        assert all(low.y1 <= high.y0 + 1.0 for low, high in pairwise(boxes))
