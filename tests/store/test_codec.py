"""Arrays and JSON come back bit for bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from app.store.codec import decode_floats, decode_json, encode_floats, encode_json
from app.store.errors import StoreError

SHAPES = arrays.array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=6)
# Any bits at all: every nan, both zeros, both infinities, subnormals.
FLOATS = SHAPES.flatmap(lambda shape: arrays.arrays(np.uint64, shape)).map(lambda bits: bits.view(np.float64))
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=8,
)


@given(FLOATS)
def test_an_array_comes_back_bit_for_bit(values):
    decoded = decode_floats(encode_floats(values), values.shape)
    assert decoded.dtype == np.float64
    assert decoded.shape == values.shape
    assert decoded.tobytes() == values.tobytes()


def test_an_array_in_another_memory_order_comes_back_equal():
    values = np.arange(12.0).reshape(3, 4).T[::-1]
    assert np.array_equal(decode_floats(encode_floats(values), values.shape), values)


def test_bytes_are_little_endian_float64():
    assert encode_floats(np.array([1.0])) == b"\x00\x00\x00\x00\x00\x00\xf0\x3f"


def test_a_decoded_array_can_be_written_to():
    assert decode_floats(encode_floats(np.zeros(2)), (2,)).flags.writeable


def test_bytes_that_do_not_fill_the_shape_are_refused():
    with pytest.raises(StoreError, match="damaged"):
        decode_floats(encode_floats(np.zeros(3)), (2, 2))


def test_bytes_that_end_inside_a_number_are_refused():
    with pytest.raises(StoreError, match="damaged"):
        decode_floats(encode_floats(np.zeros(2))[:-1], (2,))


@given(st.dictionaries(st.text(), JSON, max_size=5))
def test_json_comes_back_equal(value):
    assert decode_json(encode_json(value)) == value


@given(st.floats())
def test_a_float_in_json_comes_back_as_the_same_number(value):
    decoded = decode_json(encode_json({"x": value}))["x"]
    assert repr(decoded) == repr(value)


@given(st.text(st.characters(), min_size=1))
def test_json_text_is_ascii_whatever_the_characters(text):
    assert encode_json({"text": text}).isascii()


def test_the_order_of_keys_does_not_change_the_text():
    assert encode_json({"b": 1, "a": 2}) == encode_json({"a": 2, "b": 1}) == '{"a":2,"b":1}'


@pytest.mark.parametrize("value", [np.zeros(2), np.int64(3), b"bytes", {1, 2}, object()])
def test_what_is_not_json_is_refused(value):
    with pytest.raises(StoreError, match="plain JSON"):
        encode_json({"x": value})
