"""Random streams are named, independent of order, and stay what they are."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from study_core.streams import stream

NAMES = st.lists(
    st.integers(-5, 10**6) | st.text(st.characters(min_codepoint=32, max_codepoint=126)), max_size=4
).map(tuple)


def first_numbers(seed, names):
    return tuple(stream(seed, *names).integers(0, 2**63, 3))


# Made by this scheme when it was introduced. A change means that no stored session can be derived again:
# give the scheme a version before changing these.
GOLDEN = [
    (0, (), (2908112598742248560, 2662361775023311749, 7989056260105360595)),
    (7, ("posterior", 3, 37), (7483766951262197127, 6209200656539513191, 2356977945283942851)),
    (20211, ("test-set", 0), (6889304037317442438, 8505687058484617822, 7656813065895225956)),
    (2021, ("trajectory", "rehearsal", 5), (5417801203726738681, 8865404494410686499, 1392728123828656779)),
]


@pytest.mark.parametrize(("seed", "names", "expected"), GOLDEN)
def test_the_numbers_of_a_stream_never_change(seed, names, expected):
    assert first_numbers(seed, names) == expected


def test_a_stream_does_not_depend_on_what_was_drawn_before():
    alone = first_numbers(11, ("posterior", 1, 37))
    for earlier in range(37):
        stream(11, "posterior", 1, earlier).random(100)
    assert first_numbers(11, ("posterior", 1, 37)) == alone


@given(first=NAMES, second=NAMES)
def test_different_names_are_different_streams(first, second):
    kinds = [tuple((type(name), name) for name in names) for names in (first, second)]
    assert (first_numbers(3, first) == first_numbers(3, second)) == (kinds[0] == kinds[1])


@pytest.mark.parametrize(
    "other",
    [("posterior", 12), ("posterior", 21), ("posterior", "1", 2), (1, "posterior", 2), ("posterior1", 2)],
)
def test_names_that_look_alike_are_different_streams(other):
    assert first_numbers(3, ("posterior", 1, 2)) != first_numbers(3, other)


def test_different_seeds_are_different_streams():
    firsts = {first_numbers(seed, ("posterior", 1)) for seed in range(200)}
    assert len(firsts) == 200


def test_neighbouring_streams_are_uncorrelated():
    draws = np.array([stream(5, "order", participant).standard_normal(400) for participant in range(50)])
    correlations = np.corrcoef(draws)[np.triu_indices(50, k=1)]
    # 1,225 correlations of standard deviation 1/20: their mean square is 1/400 within a few percent.
    assert np.mean(correlations**2) == pytest.approx(1 / 400, rel=0.2)
    assert np.abs(correlations).max() < 0.25
