"""The dataset of a campaign: a part for each replicate, one Parquet file in the end.

A row is one parameter of one model, identified once (`ReplicateRow`). Its columns are the
replicate, its point and seed, what varied by key, such as "recorder.noise", and the fields of
`ReplicateRow`. The schema's metadata has one key, `helisim`, a JSON object with `format`,
`version` and `provenance`: the plan of the campaign and the versions that computed it.
"""

from collections.abc import Sequence
from dataclasses import fields
from functools import cached_property
from pathlib import Path
from types import NoneType
from typing import Any, get_args, get_type_hints

import pyarrow as pa
import pyarrow.parquet as pq

from helisim.base.errors import InputError, StorageError
from helisim.base.files import atomic_write, make_folder, parse_object, read_bytes
from helisim.records.provenance import difference, made_by, one_line, plain
from helisim.records.storage import read_table
from helisim.study.campaign.plan import Campaign, Replicate
from helisim.study.campaign.replicate import ReplicateRow
from helisim.study.campaign.variation import Levels, Variation

FORMAT = "campaign"
VERSION = 1
_METADATA = b"helisim"
_PARTS = "parts"
_NAME = "dataset.parquet"

_TYPES = {float: pa.float64(), int: pa.int64(), bool: pa.bool_(), str: pa.string()}


class Dataset:
    """The folder of one campaign.

    Args:
        folder: made when something is written.
        campaign: whose dataset it is.
    """

    def __init__(self, folder: Path, campaign: Campaign) -> None:
        self.folder = folder
        self.campaign = campaign

    @property
    def path(self) -> Path:
        """The file of the whole dataset."""
        return self.folder / _NAME

    @cached_property
    def schema(self) -> pa.Schema:
        """The columns, and the provenance."""
        columns = [("replicate", pa.int64()), ("point", pa.int64()), ("seed", pa.int64())]
        columns += [(one.key, _type_of(one)) for one in self.campaign.varied]
        hints = get_type_hints(ReplicateRow)
        columns += [(one.name, _arrow_type(hints[one.name])) for one in fields(ReplicateRow)]
        header = {"format": FORMAT, "version": VERSION, "provenance": self.provenance}
        return pa.schema(columns, metadata={_METADATA: one_line(header)})

    @cached_property
    def provenance(self) -> dict[str, Any]:
        """The plan and the versions that compute its numbers."""
        truth = {"truth": "mean over the air met"} if self.campaign.turbulent else {}
        return dict(plain(made_by("campaign", campaign=self.campaign.to_dict(), **truth)))

    def prepare(self) -> None:
        """Make the folder. Raises StorageError."""
        make_folder(self.folder / _PARTS)

    def missing(self) -> list[Replicate]:
        """Return the replicates that are not there yet; a damaged part counts as not there.

        Raises:
            InputError: the folder holds another campaign.
        """
        if self._holds(self.path):
            return []
        return [one for one in self.campaign if not self._holds(self._part(one.number))]

    def add(self, number: int, rows: Sequence[ReplicateRow]) -> None:
        """Write the part of a replicate, complete or not at all. Raises StorageError."""
        one = self.campaign.replicate(number)
        own = {"replicate": number, "point": one.point, "seed": one.seed, **one.values}
        table = pa.Table.from_pylist([own | vars(row) for row in rows], schema=self.schema)
        _write(table, self._part(number))

    def compact(self) -> Path:
        """Write all parts as one file, in order, and remove them. Raises StorageError."""
        if not self.path.exists():
            parts = [self._part(number) for number in range(len(self.campaign))]
            _write(pa.concat_tables([_read(part) for part in parts]).combine_chunks(), self.path)
        for part in (self.folder / _PARTS).glob("*.parquet"):
            part.unlink()
        if (self.folder / _PARTS).exists():
            (self.folder / _PARTS).rmdir()
        return self.path

    def _part(self, number: int) -> Path:
        return self.folder / _PARTS / f"{number:06d}.parquet"

    def _holds(self, path: Path) -> bool:
        if not path.exists():
            return False
        try:
            found = _header(path, _read(path).schema)
        except StorageError:
            return False
        change = difference(found, self.provenance)
        if change:
            raise InputError(
                f"{path} is of another campaign: {change}; choose another folder, or remove it"
            )
        return True


def read_dataset(path: str | Path) -> tuple[pa.Table, dict[str, Any]]:
    """Return a campaign's table and its provenance.

    Args:
        path: of the dataset, or of the folder that it is in.

    Raises:
        StorageError: it is missing, damaged, or something else.
    """
    path = Path(path)
    if path.is_dir():
        path = path / _NAME
    if not path.exists():
        raise StorageError(f"{path}: no such file; a campaign writes it when it is complete")
    table = _read(path)
    return table, _header(path, table.schema)


def _write(table: pa.Table, path: Path) -> None:
    with atomic_write(path) as temporary:
        pq.write_table(table, temporary, compression="zstd", write_page_checksum=True)


def _read(path: Path) -> pa.Table:
    return read_table(path, read_bytes(path))


def _header(path: Path, schema: pa.Schema) -> dict[str, Any]:
    """Return the provenance in the metadata. Raises StorageError."""
    metadata = (schema.metadata or {}).get(_METADATA)
    if metadata is None:
        raise StorageError(f"{path}: not a campaign's dataset: its schema has no 'helisim'")
    header = parse_object(metadata, f"{path}: the metadata 'helisim'")
    found = (header.get("format"), header.get("version"))
    if found != (FORMAT, VERSION) or not isinstance(header.get("provenance"), dict):
        raise StorageError(f"{path}: holds {found}, expected {(FORMAT, VERSION)} with provenance")
    return header["provenance"]


def _arrow_type(hint: Any) -> pa.DataType:
    kinds = [kind for kind in get_args(hint) or (hint,) if kind is not NoneType]
    return _TYPES[kinds[0]]


def _type_of(variation: Variation) -> pa.DataType:
    """Return the column type of what varies; numbers are doubles, written as integers or not."""
    if not isinstance(variation.law, Levels):
        return pa.float64()
    value = variation.law.values[0]
    if isinstance(value, tuple):
        return pa.list_(pa.float64())
    return _TYPES[float if type(value) is int else type(value)]
