"""Byte offsets of the fields of mjModel and mjData, found by introspection and checked.

`mujoco.introspect` describes MuJoCo's C structures; ctypes lays them out as the C compiler
did. The offsets are verified against the live objects before any compiled code uses them.
"""

import ctypes
from functools import cache
from typing import Any, NamedTuple

import mujoco
import numpy as np
from mujoco.introspect import ast_nodes, structs

from helisim.base.errors import CallbackError
from helisim.physics.kernel import known

_SCALARS: dict[str, Any] = {
    "int": ctypes.c_int,
    "unsigned int": ctypes.c_uint,
    "char": ctypes.c_char,
    "unsigned char": ctypes.c_ubyte,
    "float": ctypes.c_float,
    "double": ctypes.c_double,
    "size_t": ctypes.c_size_t,
    "uint64_t": ctypes.c_uint64,
    "uintptr_t": ctypes.c_size_t,
    "int64_t": ctypes.c_int64,
    "mjtNum": ctypes.c_double,
    "mjtByte": ctypes.c_ubyte,
    "mjtBool": ctypes.c_bool,
    "mjtSize": ctypes.c_int64,
}


@known
class Offsets(NamedTuple):
    """Byte offsets of the fields that the callbacks read or write; `fingerprint` is no field."""

    nactuator: int
    nuser_actuator: int
    nuserdata: int
    nsensor: int
    ngeom: int
    timestep: int
    wind: int
    integrator: int
    disableflags: int
    disableactuator: int
    actuator_user: int
    actuator_group: int
    actuator_dyntype: int
    actuator_actnum: int
    actuator_trntype: int
    actuator_trnid: int
    actuator_actadr: int
    actuator_ctrladr: int
    actuator_history: int
    actuator_historyadr: int
    actuator_delay: int
    jnt_type: int
    jnt_bodyid: int
    body_rootid: int
    body_dofadr: int
    body_dofnum: int
    dof_parentid: int
    geom_type: int
    geom_contype: int
    geom_conaffinity: int
    geom_bodyid: int
    geom_size: int
    sensor_type: int
    sensor_dim: int
    sensor_adr: int
    sensor_objtype: int
    sensor_objid: int
    sensor_interval: int
    names: int
    name_bodyadr: int
    name_actuatoradr: int
    name_sensoradr: int
    time: int
    act: int
    act_dot: int
    ctrl: int
    history: int
    xpos: int
    xmat: int
    cvel: int
    cdof: int
    subtree_com: int
    geom_xpos: int
    geom_xmat: int
    qfrc_passive: int
    qfrc_constraint: int
    sensordata: int
    userdata: int
    timer: int
    fingerprint: int = 0


_OPTION = ("timestep", "wind", "integrator", "disableflags", "disableactuator")
_INTS = _OPTION[2:]
_DATA = (
    "time",
    "act",
    "act_dot",
    "ctrl",
    "history",
    "xpos",
    "xmat",
    "cvel",
    "cdof",
    "subtree_com",
    "geom_xpos",
    "geom_xmat",
    "qfrc_passive",
    "qfrc_constraint",
    "sensordata",
    "userdata",
    "timer",
)
_FIELDS = Offsets._fields[:-1]
POSITION_COUNT = 16 * int(mujoco.mjtTimer.mjTIMER_POSITION) + 8
"""Where among mjData's timers, pairs of a duration and a count, evaluations are counted, bytes."""
_ALIGNED = 64
"""Bytes; MuJoCo's arrays start at multiples of them."""


@cache
def offsets() -> Offsets:
    """Return the byte offset of every field.

    Raises:
        CallbackError: this MuJoCo's structures are not laid out as it describes them.
    """
    model = _structure("mjModel")
    data = _structure("mjData")
    option = _structure("mjOption")
    try:
        found = Offsets(*(_offset(name, model, data, option) for name in _FIELDS))
    except AttributeError as error:
        raise CallbackError(
            f"MuJoCo {mujoco.__version__} has no field that helisim needs: {error}; "
            "install a version that this helisim supports"
        ) from None
    _verify(found)
    return found


def _offset(name: str, model: Any, data: Any, option: Any) -> int:
    if name in _OPTION:
        return model.opt.offset + getattr(option, name).offset
    return getattr(data if name in _DATA else model, name).offset


@cache
def _structure(name: str) -> type[ctypes.Structure]:
    declared = structs.STRUCTS.get(name) or structs.STRUCTS[name.rstrip("_")]
    return _layout(name, declared.fields)


def _layout(name: str, fields: Any) -> type[ctypes.Structure]:
    members = []
    for index, field in enumerate(fields):
        label = getattr(field, "name", None) or f"anonymous_{index}"
        members.append((label, _ctype(getattr(field, "type", field), f"{name}_{label}")))
    return type(name, (ctypes.Structure,), {"_fields_": members})


def _ctype(node: Any, name: str) -> Any:
    if isinstance(node, ast_nodes.PointerType):
        return ctypes.c_void_p
    if isinstance(node, ast_nodes.ArrayType):
        element = _ctype(node.inner_type, name)
        for extent in reversed(node.extents):
            element = element * extent
        return element
    if isinstance(node, ast_nodes.AnonymousStructDecl):
        return _layout(name, node.fields)
    if node.name in _SCALARS:
        return _SCALARS[node.name]
    declared = structs.STRUCTS.get(node.name) or structs.STRUCTS.get(f"{node.name}_")
    if declared is not None:
        return _layout(node.name, declared.fields)
    return ctypes.c_int  # enumerations


_PROBE = """
<mujoco>
  <option timestep="0.00137" integrator="RK4" wind="1.25 2.5 3.75" actuatorgroupdisable="2 5">
    <flag warmstart="disable" sensor="disable"/>
  </option>
  <size nuser_actuator="3" nuserdata="2"/>
  <worldbody>
    <body name="b">
      <freejoint name="j"/>
      <geom size="0.1"/>
    </body>
  </worldbody>
  <actuator>
    <general joint="j" dyntype="user" actdim="2" delay="0.01" nsample="9" user="1 2 3"/>
    <general joint="j" dyntype="user" actdim="1"/>
  </actuator>
  <sensor>
    <user dim="2" objtype="body" objname="b" needstage="acc" datatype="real"/>
  </sensor>
</mujoco>
"""


def _verify(found: Offsets) -> None:
    model = mujoco.MjModel.from_xml_string(_PROBE)
    data = mujoco.MjData(model)
    data.time = 0.625
    for name in _FIELDS:
        owner = data if name in _DATA else model.opt if name in _OPTION else model
        base = data._address if name in _DATA else model._address
        expected = getattr(owner, name)
        if name == "timer":
            agrees = _counts(base + found.timer, model, data)
        elif isinstance(expected, bytes):
            agrees = _holds_names(base + getattr(found, name), model)
        else:
            agrees = _agrees(base + getattr(found, name), expected, name)
        if not agrees:
            raise CallbackError(
                f"MuJoCo {mujoco.__version__}: field {name!r} is not where the introspection "
                "says; the compiled force laws would read the wrong memory. Install a version "
                "of MuJoCo that this helisim supports"
            )


def _agrees(address: int, expected: Any, name: str) -> bool:
    if isinstance(expected, np.ndarray):
        held = expected.__array_interface__["data"][0]
        by_value = name in _OPTION
        return held == (address if by_value else ctypes.c_void_p.from_address(address).value)
    if isinstance(expected, float):
        return ctypes.c_double.from_address(address).value == expected
    size = ctypes.c_int if name in _INTS else ctypes.c_int64
    return size.from_address(address).value == int(expected)


def _evaluations(address: int) -> int:
    """Return how often the positions of mjData were evaluated, from where its timers are."""
    return ctypes.c_int.from_address(address + POSITION_COUNT).value


def _counts(address: int, model: mujoco.MjModel, data: mujoco.MjData) -> bool:
    """Return whether mjData's timers are there: whether evaluations are counted."""
    before = _evaluations(address)
    mujoco.mj_fwdPosition(model, data)
    after = data.timer[mujoco.mjtTimer.mjTIMER_POSITION].number
    return _evaluations(address) == after == before + 1


def _holds_names(address: int, model: mujoco.MjModel) -> bool:
    """Return whether a pointer field holds the names, which end where their map begins."""
    held = ctypes.c_void_p.from_address(address).value or 0
    between = model.names_map.__array_interface__["data"][0] - held - len(model.names)
    return 0 <= between < _ALIGNED and ctypes.string_at(held, len(model.names)) == model.names
