"""The physical parameters of a vehicle: named values with units and where they come from."""

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from helisim.errors import InputError, ModelError, StorageError, UnknownNameError
from helisim.records.files import read_toml


@dataclass(frozen=True)
class Parameter:
    """One physical parameter: dotted name, value, unit (SI) and source."""

    name: str
    value: float
    unit: str
    source: str


class Parameters(Mapping[str, float]):
    """Values by dotted name, such as `main_rotor.lift_slope`. Read-only.

    Raises:
        UnknownNameError: on a name that does not exist; the message lists those that do.
    """

    def __init__(self, entries: Mapping[str, Parameter]) -> None:
        self._entries = dict(entries)

    def __getitem__(self, name: str) -> float:
        return self.entry(name).value

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __contains__(self, name: object) -> bool:
        return name in self._entries

    def entry(self, name: str) -> Parameter:
        """Return value, unit and source of one parameter."""
        try:
            return self._entries[name]
        except KeyError:
            raise UnknownNameError("parameter", name, sorted(self._entries)) from None

    def replace(
        self, changes: Mapping[str, float], source: str = "set by the user"
    ) -> "Parameters":
        """Return a copy with some values changed.

        Raises:
            UnknownNameError: no such parameter.
            InputError: a value is not a finite number.
        """
        entries = dict(self._entries)
        for name, value in changes.items():
            old = self.entry(name)
            number = float(value)
            if not math.isfinite(number):
                raise InputError(f"parameter {name!r} must be a finite number, got {value!r}")
            entries[name] = Parameter(name, number, old.unit, source)
        return Parameters(entries)


def read_parameters(*paths: Path) -> Parameters:
    """Read parameter files (TOML); a later file adds to the earlier ones.

    Raises:
        ModelError: a file is missing or malformed, or a name is defined twice.
    """
    entries: dict[str, Parameter] = {}
    for path in paths:
        for name, entry in _read(path).items():
            if name in entries:
                raise ModelError(f"{path}: parameter {name!r} is already defined")
            entries[name] = entry
    return Parameters(entries)


_UNTUNED = {
    "gyro.ped_latency": (0.0, "s"),
    "gyro.kp_lat": (0.0, "s/rad"),
    "gyro.kp_lon": (0.0, "s/rad"),
    "gyro.ki_lat": (1.0, "1/rad"),
    "gyro.ki_lon": (1.0, "1/rad"),
    "gyro.kd_lat": (0.0, "s^2/rad"),
    "gyro.kd_lon": (0.0, "s^2/rad"),
    "gyro.phase": (0.0, "rad"),
    "gyro.k_p": (0.0, "1"),
    "gyro.k_i": (1.0, "1/s"),
    "gyro.k_delta": (1.0, "1"),
    "gyro.k_a": (0.1, "s/rad"),
    "gyro.p_per_lat": (1.0, "rad/s"),
    "gyro.p_per_lon": (0.0, "rad/s"),
    "gyro.q_per_lat": (0.0, "rad/s"),
    "gyro.q_per_lon": (1.0, "rad/s"),
}


def untuned(parameters: Parameters) -> Parameters:
    """Return the parameters with plain values for what is missing of the gyro's settings.

    A vehicle can be calibrated and its gyro tuned with them; to fly it needs tuned ones.
    """
    plain = {
        name: Parameter(name, value, unit, "not tuned yet")
        for name, (value, unit) in _UNTUNED.items()
    }
    return Parameters({**plain, **{name: parameters.entry(name) for name in parameters}})


def _read(path: Path) -> dict[str, Parameter]:
    try:
        content = read_toml(path)
    except StorageError as error:
        raise ModelError(f"can't read parameters: {error}") from None
    entries = {}
    for section, members in content.items():
        if not isinstance(members, dict):
            raise ModelError(f"{path}: {section} must stand in a section, such as [air]")
        for key, item in members.items():
            name = f"{section}.{key}"
            try:
                entries[name] = Parameter(
                    name, float(item["value"]), str(item["unit"]), str(item["source"])
                )
            except (TypeError, KeyError, ValueError):
                raise ModelError(
                    f"{path}: {name} needs value (a number), unit and source, got {item!r}"
                ) from None
            if not math.isfinite(entries[name].value):
                raise ModelError(f"{path}: {name} must be finite, got {item['value']!r}")
    return entries


def to_toml(parameters: Parameters, header: str) -> str:
    """Return parameters as the text of a parameter file, sections in order of appearance."""
    lines = [f"# {line}".rstrip() for line in header.splitlines()]
    for section in dict.fromkeys(name.split(".")[0] for name in parameters):
        lines += ["", f"[{section}]"]
        for name in parameters:
            prefix, key = name.split(".")
            if prefix != section:
                continue
            entry = parameters.entry(name)
            lines.append(
                f"{key} = {{ value = {entry.value!r}, unit = {json.dumps(entry.unit)}, "
                f"source = {json.dumps(entry.source)} }}"
            )
    return "\n".join(lines) + "\n"
