"""A battery: voltage at rest by charge, resistance by charge and temperature, one slow drop.

The circuit, its voltage at rest and the rise of the resistance near the end are those of M. Chen
and G. Rincon-Mora, IEEE Transactions on Energy Conversion 21 (2006), for polymer lithium cells.
"""

import math
from collections import namedtuple

from helisim.physics.kernel import kernel
from helisim.physics.layout import PARAM

REFERENCE = 298.15  # K, of `battery.resistance`
_RISE, _END = 2.098, 24.37  # 0.1562 / 0.07446 of the resistance, as exp(-24.37 charge)
_EMPTY = -0.05  # charge below which nothing changes: the voltage is gone

Supply = namedtuple("Supply", "voltage resistance")
"""V and ohm, as a speed controller sees them; the slow drop is taken off."""


@kernel()
def supply(par, discharge, polarisation, warming):
    """Return the `Supply`; discharge: share taken; polarisation: V; warming: K above the start."""
    if par[PARAM.drive_supply] == 0.0:
        return Supply(par[PARAM.drive_voltage], 0.0)
    left, cells = max(_EMPTY, par[PARAM.battery_charge] - discharge), par[PARAM.battery_cells]
    cell = par[PARAM.battery_voltage_3]
    for k in range(2, -1, -1):
        cell = cell * left + par[PARAM.battery_voltage_0 + k]
    cell -= par[PARAM.battery_end_voltage] * math.exp(-left * par[PARAM.battery_end])
    resistance = par[PARAM.battery_resistance] * (1.0 + _RISE * math.exp(-_END * left))
    temperature = par[PARAM.battery_temperature] + warming
    cold = par[PARAM.battery_activation] * (1.0 / temperature - 1.0 / REFERENCE)
    return Supply(max(0.0, cells * cell - polarisation), resistance * math.exp(cold))


@kernel()
def battery_current(source, volts, amperes):
    """Return the current of a battery whose speed controller gives a motor volts and amperes, A.

    The controller has no losses of its own, and nothing flows back.
    """
    power, voltage = volts * amperes, source.voltage
    if power <= 0.0 or voltage <= 0.0:
        return 0.0
    root = voltage**2 - 4.0 * source.resistance * power
    return 2.0 * power / (voltage + math.sqrt(max(0.0, root)))


@kernel()
def battery_rates(par, source, current, polarisation, warming):
    """Return the rates of discharge, 1/s, polarisation, V/s, and warming, K/s; current: A."""
    slow = par[PARAM.battery_polarisation]
    heat = source.resistance * current**2 + polarisation**2 / slow
    heat -= par[PARAM.battery_cooling] * warming
    return (
        current / par[PARAM.battery_capacity],
        (slow * current - polarisation) / par[PARAM.battery_lag],
        heat / par[PARAM.battery_heat_capacity],
    )
