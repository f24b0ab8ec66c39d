"""Which pair to ask next: one method, one file, each a function from posterior samples to ranked pairs.

A method ranks pairs of samples; `study_core.queries` turns the best pair whose optimal trajectories differ into
a query. Methods are registered here by the name a study file uses.
"""

from __future__ import annotations

from study_core.acquisition import heuristic, random_pair
from study_core.acquisition.pairs import Acquisition
from study_core.errors import UnknownNameError

METHODS: dict[str, Acquisition] = {
    "heuristic": heuristic.rank_pairs,
    "random": random_pair.rank_pairs,
}


def acquisition_named(name: str) -> Acquisition:
    """Returns the method of that name.

    Raises:
        UnknownNameError: There is no such method.
    """
    if name not in METHODS:
        raise UnknownNameError("acquisition method", name, METHODS)
    return METHODS[name]
