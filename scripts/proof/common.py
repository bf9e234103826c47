"""What proofs by simulated truths share: truths of TOML files, records, quiet fits, words."""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from helisim.base.errors import HelisimError
from helisim.base.files import read_toml
from helisim.ident import Structure, structures
from helisim.records.record import Channel, channel


def truths(path: Any, kind: type) -> dict[str, Any]:
    """Return the truths of a TOML file, each with its structure: a name's, or a table's own."""
    found = {}
    for name, table in read_toml(path).items():
        how = table.pop("structure", name)
        if isinstance(how, Mapping) and "zeros" in how:
            structure = structures.transfer_function(**how)
        else:
            structure = structures.named(how) if isinstance(how, str) else Structure.from_dict(how)
        found[name] = kind(structure, **table)
    return found


def channel_of(name: str) -> Channel:
    try:
        return channel(name)
    except HelisimError:
        return Channel(name, "1", "OTHER", name)


def law_of(truth: Any, states: Sequence[str]) -> np.ndarray:
    """Return a truth's feedback, (n_in, n_state), of what it says by input and state."""
    return np.array(
        [[truth.law.get(i, {}).get(x, 0.0) for x in states] for i in truth.structure.inputs]
    )


def wanted(only: str, name: str) -> bool:
    """Return whether a name has one of the parts that are asked for, commas between."""
    return any(one in name for one in only.split(","))


def counted(words: Sequence[str]) -> str:
    return ", ".join(f"{words.count(one)} {one}" for one in dict.fromkeys(words))


@contextmanager
def quiet() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
