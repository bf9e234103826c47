"""Error models as plain data: what comes back, and what is refused."""

import copy
import json

import numpy as np
import pytest

from helisim.base.errors import InputError
from helisim.ident.scatter import (
    LineWeights,
    LocalScatter,
    _digest,
    scatter_from_plain,
    scatter_to_plain,
)

RESPONSE = np.ones((1, 1, 2), dtype=complex)
MODEL = LocalScatter(
    frequency=np.array([1.0, 2.0]),
    weights=tuple(
        LineWeights(np.array([0]), np.array([k]), np.full((1, 1, 1, 3), 1j * k, dtype=np.complex64))
        for k in (1, 2)
    ),
    share=np.ones((1, 1, 1, 2)),
    noise=np.ones((2, 1, 1), dtype=complex),
    bias=np.zeros((1, 1, 2)),
    spread=np.zeros((1, 1, 2)),
)


def spoiled(change):
    """Return the model's plain data after a change, with the digest that belongs to them."""
    data = copy.deepcopy(scatter_to_plain(MODEL, RESPONSE))
    change(data["model"])
    return {**data, "digest": _digest(data["model"], RESPONSE)}


def test_all_numbers_come_back_to_the_last_bit():
    """Through JSON, with types and shapes; arrays can't be changed."""
    again = scatter_from_plain(json.loads(json.dumps(scatter_to_plain(MODEL, RESPONSE))), RESPONSE)
    assert again == MODEL
    assert again.weights[1].value.dtype == np.complex64
    assert not again.noise.flags.writeable


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: m["bias"].update(base64="AAAA*AAAA"), "can't be read|isn't base64"),
        (lambda m: m["bias"].update(base64="AAA"), "an array isn't base64"),
        (lambda m: m["bias"].update(type="<f2"), "has the type '<f2', expected <f8, <f4"),
        (lambda m: m["bias"].update(type="|O"), r"has the type '\|O', expected <f8"),
        (lambda m: m["bias"].update(shape=[7]), "can't be read: cannot reshape"),
        (lambda m: m.update(kind="object"), "can't be read: 'object'"),
        (lambda m: m.pop("share"), "can't be read: .*'share'"),
        (lambda m: m.update(more=1), "can't be read: .*'more'"),
    ],
)
def test_what_is_no_error_model_is_refused(change, message):
    """Though its digest is right: nothing is guessed, no object is built."""
    with pytest.raises(InputError, match=message):
        scatter_from_plain(spoiled(change), RESPONSE)


def test_another_response_or_a_changed_number_is_noticed():
    """The digest is of both."""
    data = scatter_to_plain(MODEL, RESPONSE)
    with pytest.raises(InputError, match="isn't that of the response"):
        scatter_from_plain(data, 2.0 * RESPONSE)
    data["model"]["bias"]["shape"] = [2, 1, 1]
    with pytest.raises(InputError, match="isn't that of the response"):
        scatter_from_plain(data, RESPONSE)
