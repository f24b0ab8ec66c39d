"""People of known weights, who answer with lapses."""

import numpy as np

SHARED = np.array([1.5, -1.0, 0.5, 0.0, 0.0])
PERSONAL_SCALE = 0.6
LAPSE_RATE = 0.03


def personal_weights(rng, n_people, shared=SHARED, personal_scale=PERSONAL_SCALE):
    return shared + personal_scale * rng.normal(size=(n_people, len(shared)))


def signed_diffs(rng, weights, n, lapse_rate=LAPSE_RATE):
    """Returns random feature differences, turned so that what was preferred comes first, shape `(n, k)`."""
    diffs = rng.normal(size=(n, len(weights)))
    meant = np.sign(diffs @ weights + rng.logistic(size=n))
    is_lapse = rng.random(n) < lapse_rate
    return diffs * np.where(is_lapse, rng.choice([-1.0, 1.0], n), meant)[:, None]


def crowd(seed, n_people, n, **changes):
    """Returns people's true weights and what they preferred."""
    rng = np.random.default_rng(seed)
    weights = personal_weights(rng, n_people, **changes)
    return weights, [signed_diffs(rng, one, n) for one in weights]
