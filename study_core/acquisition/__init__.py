"""Which pair to ask next: one method, one file, each a function from what is known to ranked pairs.

`study_core.queries` shows the best pair whose drives look different. Methods are registered here by the name a study
file uses.
"""

from __future__ import annotations

from study_core.acquisition.heuristic import HEURISTIC
from study_core.acquisition.heuristic_relative import HEURISTIC_RELATIVE
from study_core.acquisition.information_gain import INFORMATION_GAIN
from study_core.acquisition.information_gain_realistic import INFORMATION_GAIN_REALISTIC
from study_core.acquisition.pairs import Acquisition
from study_core.acquisition.random_drives import RANDOM
from study_core.acquisition.regret import REGRET
from study_core.acquisition.thompson import THOMPSON
from study_core.acquisition.volume_removal import VOLUME_REMOVAL
from study_core.errors import UnknownNameError

METHODS: dict[str, Acquisition] = {
    "heuristic": HEURISTIC,
    "heuristic-relative": HEURISTIC_RELATIVE,
    "information-gain": INFORMATION_GAIN,
    "information-gain-realistic": INFORMATION_GAIN_REALISTIC,
    "volume-removal": VOLUME_REMOVAL,
    "regret": REGRET,
    "thompson": THOMPSON,
    "random": RANDOM,
}


def acquisition_named(name: str) -> Acquisition:
    """Returns the method of that name.

    Raises:
        UnknownNameError: There is no such method.
    """
    if name not in METHODS:
        raise UnknownNameError("acquisition method", name, METHODS)
    return METHODS[name]
