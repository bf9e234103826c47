"""Roll and pitch with the speeds that a hovering helicopter gathers as it tilts.

The tilted thrust accelerates it, and the disc flaps back from the speed: at three times the
frequency of the hover's slow modes that is still several percent of the rates. What fuselage and
tail add to the rotor's damping is smaller, but moves the rotor's time constant by a tenth of a
percent or two.
"""

from helisim.base.units import STANDARD_GRAVITY
from helisim.ident.model.structure import Parameter, Structure


def with_speeds(flapping: Structure, name: str) -> Structure:
    """Return a model of p, q and tilts a, b with speeds, attitudes, flap-back and two dampings.

    Args:
        flapping: with states p, q, a, b, whose rows of a and b are tau_f (da/dt + q) = -a + A_b b
            + ... and its like.
        name: of the new one.
    """
    old = flapping.states
    states = (*old, "u", "v", "phi", "theta")
    place = {state: states.index(state) for state in states}
    rates = [[*row, *["0"] * 4] for row in flapping.F] + [["0"] * len(states) for _ in range(4)]
    for row, cells in {
        "p": {"p": "L_p"},
        "q": {"q": "M_q"},
        "a": {"u": "A_u"},
        "b": {"v": "-A_u"},  # the rotor is round
        "u": {"theta": "-g", "a": "-g"},
        "v": {"phi": "g", "b": "g"},
        "phi": {"p": "1"},
        "theta": {"q": "1"},
    }.items():
        for column, cell in cells.items():
            rates[place[row]][place[column]] = cell
    mass = [[*row, *["0"] * 4] for row in flapping.M]
    mass += [["1" if k == len(old) + j else "0" for k in range(len(states))] for j in range(4)]
    damping = (-3.0, 1.0)
    return Structure(
        name=name,
        meaning=f"{flapping.meaning}, with the speeds that tilting gathers: flap-back, and the "
        "dampings of fuselage and tail",
        parameters=(
            *flapping.parameters,
            Parameter("A_u", "rad s/m", 1e-3, (-0.02, 0.02), "flap-back by forward velocity"),
            Parameter("L_p", "1/s", -0.03, damping, "roll damping beside the rotor's", 0.1),
            Parameter("M_q", "1/s", -0.03, damping, "pitch damping beside the rotor's", 0.1),
        ),
        states=states,
        inputs=flapping.inputs,
        outputs=flapping.outputs,
        M=tuple(map(tuple, mass)),
        F=tuple(map(tuple, rates)),
        G=(*flapping.G, *((("0",) * len(flapping.inputs),) * 4)),
        input_delays=flapping.input_delays,
        constants={"g": STANDARD_GRAVITY},
    )
