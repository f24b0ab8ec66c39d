"""People whose predictions are scored. The only place where training and test answers stand side by side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from study_core.predictors.predictor import Pairs, Training


@dataclass(frozen=True)
class TestAnswers:
    """What a person preferred in the common test queries; no predictor ever gets it.

    Attributes:
        pairs: What was compared.
        signs: +1 where A was preferred, -1 where B was, shape `(n,)`.
    """

    # pytest takes every `Test...` for a test.
    __test__ = False

    pairs: Pairs
    signs: Float[np.ndarray, " n"]

    def __len__(self) -> int:
        return len(self.signs)


@dataclass(frozen=True)
class Person:
    """A person who has finished a study.

    Attributes:
        name: As it is reported.
        training: Active answers.
        test: Common test answers; at least one.
    """

    name: str
    training: Training
    test: TestAnswers
