"""Every predictor, simplest first."""

from __future__ import annotations

from study_core.predictors.hand_coded import HandCodedCalibrated, HandCodedStored
from study_core.predictors.hand_coded_population import HandCodedPopulation
from study_core.predictors.hierarchical import Hierarchical
from study_core.predictors.personal_calibrated import PersonalCalibrated
from study_core.predictors.personal_network import PersonalNetwork
from study_core.predictors.predictor import Predictor
from study_core.predictors.shared_network import SharedNetwork


def all_predictors(n_threads: int) -> tuple[Predictor, ...]:
    """Returns what an evaluation compares.

    Args:
        n_threads: Threads that train a person's networks; the result doesn't depend on it.
    """
    return (
        HandCodedStored(),
        HandCodedCalibrated(),
        HandCodedPopulation(),
        PersonalNetwork(n_threads=n_threads),
        PersonalCalibrated(n_threads=n_threads),
        SharedNetwork(),
        Hierarchical(),
    )
