"""What the page of one person shows: pictures of what was believed of them, and of how they answered."""

from __future__ import annotations

from dataclasses import dataclass

from markupsafe import Markup

from app.desk import charts
from app.services.history import Belief, History
from app.services.monitor import LARGEST_R_HAT


@dataclass(frozen=True)
class Picture:
    """A picture with its title."""

    title: str
    drawn: Markup


def posterior_picture(history: History) -> Markup | None:
    """Returns the last posterior: each weight's mean and 90 % interval; None where nothing was inferred."""
    if not history.beliefs:
        return None
    last = history.beliefs[-1]
    return charts.intervals(_names(history), last.mean, last.low, last.high)


def courses(history: History) -> list[Picture]:
    """Returns how weights, diagnostics and response times went, question by question."""
    return [*_weights(history), *_diagnostics(history), *_responses(history)]


def _weights(history: History) -> list[Picture]:
    pictures = []
    for number, name in enumerate(_names(history)):
        # A learned feature has no weight before it is learned.
        known = [belief for belief in history.beliefs if len(belief.mean) > number]
        means, lows, highs = (
            [float(getattr(belief, what)[number]) for belief in known] for what in ("mean", "low", "high")
        )
        queries = [belief.query_index for belief in known]
        pictures.append(Picture(name, charts.band(name, queries, means, lows, highs)))
    return pictures


def _diagnostics(history: History) -> list[Picture]:
    pictures = []
    r_hats = [(belief.query_index, belief.r_hat) for belief in history.beliefs if belief.r_hat is not None]
    if r_hats:
        queries, values = [query for query, _ in r_hats], [value for _, value in r_hats]
        top = max(1.2, *values)
        scale = charts.Scale(1.0, top, (1.0, LARGEST_R_HAT, top), lambda value: f"{value:.2f}")
        pictures.append(Picture("R-hat", charts.course("R-hat", queries, values, scale, LARGEST_R_HAT)))
    sizes = [(belief.query_index, belief.ess) for belief in history.beliefs if belief.ess is not None]
    if sizes:
        queries, values = [query for query, _ in sizes], [value for _, value in sizes]
        scale = charts.up_to(max(values), lambda value: f"{value:.0f}")
        label = "Effective sample size"
        pictures.append(Picture(label, charts.course(label, queries, values, scale)))
    return pictures


def _responses(history: History) -> list[Picture]:
    timed = [(asked.query_index, asked.response_s) for asked in history.asked if asked.response_s is not None]
    if not timed:
        return []
    queries, seconds = [query for query, _ in timed], [value for _, value in timed]
    scale = charts.Scale(0.5, max(60.0, *seconds), (0.5, 5.0, 60.0), lambda value: f"{value:.3g} s", True)
    return [Picture("Response time", charts.course("Response time", queries, seconds, scale))]


def _names(history: History) -> list[str]:
    """Returns the weights' names; those of a study that can't be read here are numbered."""
    last: Belief | None = history.beliefs[-1] if history.beliefs else None
    n_weights = 0 if last is None else len(last.mean)
    return list(history.weight_names) or [f"weight {number + 1}" for number in range(n_weights)]
