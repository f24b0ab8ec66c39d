"""Other people's samplers on the target of `prefstudy bench posterior`; one library, one file.

Each module draws from the posterior over w under a uniform prior on the nonnegative part of the sphere and a sigmoid
with lapses, in coordinates that suit its sampler. Their libraries are the `bench` extra and never a dependency.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module

import numpy as np
from jaxtyping import Float

Draw = Callable[
    [int, Float[np.ndarray, "n_answers n_features"]], Float[np.ndarray, "n_chains n_draws n_features"]
]
"""Takes a seed and Phi(preferred) - Phi(other) of each answer; gives w at every step after warm-up."""

INSTALL = ".venv/bin/pip install -c constraints.txt -e '.[bench]'"
"""What installs every library."""

_MODULES = {"emcee": "emcee_kde", "numpyro": "numpyro_nuts", "blackjax": "blackjax_hmc"}


@dataclass(frozen=True)
class Peer:
    """A sampler that is installed.

    Attributes:
        name: Of the library.
        settings: How it is run, in words.
        draw: Runs it, warm-up included; compiles on the first call for a number of answers.
    """

    name: str
    settings: str
    draw: Draw


def installed_peers() -> tuple[list[Peer], list[str]]:
    """Returns the samplers whose library is installed, and the names of the others."""
    found, missing = [], []
    for library, module_name in _MODULES.items():
        try:
            module = import_module(f"{__name__}.{module_name}")
        except ModuleNotFoundError as error:
            # Anything else that is missing is a mistake of ours.
            if error.name not in (library, "jax"):
                raise
            missing.append(library)
        else:
            found.append(Peer(library, module.SETTINGS, module.draw))
    return found, missing
