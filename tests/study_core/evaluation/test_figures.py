"""Figures show the data they are given: looked for in the artists, not in pixels."""

import io

import numpy as np
import pytest

from study_core.comparison import Query
from study_core.domains.driving.domain import DRIVING_V1
from study_core.domains.driving.dynamics import HUMAN_PATH
from study_core.evaluation.figures import (
    accuracies,
    calibration,
    heat_maps,
    learned_feature,
    learning,
    optimal_drives,
    queries,
    weights,
)
from study_core.evaluation.figures.style import PREDICTOR_COLOURS, spread_labels
from study_core.evaluation.intervals import Mean
from study_core.evaluation.scores import CalibrationBin

PEOPLE = ("1", "2", "3")


def svg_of(figure):
    with io.StringIO() as text:
        figure.savefig(text, format="svg")
        return text.getvalue()


def drives(n):
    return np.random.default_rng(1).uniform(-1.0, 1.0, (n, 10))


def query(controls):
    return Query(controls[0], controls[1], np.zeros(4), np.zeros(4))


def test_bars_are_as_high_as_accuracies_and_know_whose_they_are():
    accuracy = {name: {"1": 0.5, "2": 0.6, "3": 0.7} for name in PREDICTOR_COLOURS}
    trials = {person: [0.7, 0.8] for person in PEOPLE}
    means = {name: Mean(0.6, 0.5, 0.7) for name in PREDICTOR_COLOURS}
    figure = accuracies.draw(accuracy, trials, means)
    heights = [bar.get_height() for bar in figure.axes[0].patches]
    np.testing.assert_allclose(heights, [0.5, 0.75, 0.6, 0.75, 0.7, 0.75])
    text = svg_of(figure)
    assert all(f'id="person:{person}"' in text for person in PEOPLE)


def test_a_calibrated_predictor_is_drawn_on_the_diagonal():
    bins = [CalibrationBin(level, level, 100) for level in (0.55, 0.75, 0.95)]
    figure = calibration.draw(dict.fromkeys(PREDICTOR_COLOURS, bins))
    panels = [axes for axes in figure.axes if axes.get_visible()]
    assert len(panels) == len(PREDICTOR_COLOURS)
    for axes in panels:
        points = axes.lines[1].get_xydata()
        np.testing.assert_allclose(points[:, 0], points[:, 1])


def test_every_curve_is_named_at_its_end():
    curves = {name: {0: Mean(0.6, 0.5, 0.7), 5: Mean(0.7, 0.6, 0.8)} for name in PREDICTOR_COLOURS}
    figure = learning.draw(curves, curves, 0.7)
    for axes in figure.axes:
        assert set(PREDICTOR_COLOURS) <= {text.get_text() for text in axes.texts}


def test_the_other_car_stands_in_the_heat_map_where_it_is_and_the_feature_is_that_place_s():
    def distance(inputs):
        return inputs[:, 1]

    maps = np.stack([heat_maps.over_the_road(DRIVING_V1, distance, moment) for moment in heat_maps.MOMENTS])
    figure = heat_maps.draw(DRIVING_V1, maps)
    for axes, values, moment in zip(figure.axes, maps, heat_maps.MOMENTS, strict=False):
        car = axes.patches[0]
        there = HUMAN_PATH[moment + 1, :2]
        np.testing.assert_allclose(np.array(car.get_center())[::-1], there)
        row, column = np.unravel_index(values.argmin(), values.shape)
        along = np.linspace(-0.6, 2.6, values.shape[0])[row]
        across = np.linspace(-0.4, 0.4, values.shape[1])[column]
        np.testing.assert_allclose([across, along], there, atol=0.02)


def test_inputs_that_are_held_stay():
    held = learned_feature.Held(("x", "distance", "heading", "speed"), (0.0, 0.5, 1.0, 0.8))
    inputs = held.varied("heading", np.array([0.1, 0.2]))
    np.testing.assert_array_equal(inputs, [[0.0, 0.5, 0.1, 0.8], [0.0, 0.5, 0.2, 0.8]])
    values = learned_feature.against_heading(lambda inputs: np.sin(inputs[:, 2]), held)
    learned, sine = (line.get_ydata() for line in learned_feature.draw_one(values).axes[0].lines[1::-1])
    np.testing.assert_allclose(learned, sine)


def test_everybody_s_line_is_there_for_heading_and_speed():
    headings = {person: np.zeros(len(learned_feature.HEADINGS_DEG)) for person in PEOPLE}
    speeds = {person: np.zeros(len(learned_feature.SPEEDS)) for person in PEOPLE}
    text = svg_of(learned_feature.draw_all(headings, speeds))
    assert all(text.count(f'id="person:{person}"') == 2 for person in PEOPLE)


@pytest.mark.parametrize("n_ways", [1, 2, 4])
def test_whole_drives_are_in_the_frame(n_ways):
    controls = drives(len(PEOPLE))
    ways = {f"way {k}": dict(zip(PEOPLE, controls, strict=True)) for k in range(n_ways)}
    figure = optimal_drives.draw(DRIVING_V1, ways)
    for axes in figure.axes[:n_ways]:
        low, high = sorted(axes.get_ylim())
        start, end = axes.get_xlim()
        paths = np.concatenate([line.get_xydata() for line in axes.lines if line.get_gid()])
        assert len(paths) == 51 * len(PEOPLE)
        np.testing.assert_array_equal(np.clip(paths, (start, low), (end, high)), paths)


def test_both_drives_of_a_query_are_named():
    figure = queries.draw(DRIVING_V1, {"random": query(drives(2)), "heuristic": query(drives(4)[2:])})
    for axes in figure.axes:
        assert {"A", "B"} <= {text.get_text() for text in axes.texts}


def test_the_ranges_of_the_weights_are_those_of_the_samples():
    samples = {person: np.random.default_rng(2).random((400, 4)) for person in PEOPLE}
    figure = weights.draw(DRIVING_V1.feature_names, samples)
    for k, axes in enumerate(figure.axes):
        low, high = np.quantile(samples["1"][:, k], [0.05, 0.95])
        np.testing.assert_allclose(axes.lines[0].get_xdata(), [low, high])


def test_labels_keep_their_order_and_their_distance():
    rng = np.random.default_rng(3)
    for _ in range(20):
        wanted = rng.random(7).tolist()
        placed = np.array(spread_labels(wanted, 0.2))
        order = np.argsort(wanted, kind="stable")
        assert (np.diff(placed[order]) >= 0.2 - 1e-12).all()
    far = [0.0, 1.0, 2.0]
    assert spread_labels(far, 0.2) == far
