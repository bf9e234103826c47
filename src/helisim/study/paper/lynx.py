"""The derivatives and trims of a Westland Lynx, 0 to 120 kn.

Two sources. SI, radians, forward-right-down; blades turn counter-clockwise, and the pitch of a
blade is theta_0 + theta_1s sin(psi) + theta_1c cos(psi), psi from the tail: a positive theta_1s
tilts the disc back, a positive theta_1c to the left.

1. G. D. Padfield, Helicopter Flight Dynamics, appendix 4B: the linearised Helisim model of the
   Lynx at 0, 20, 40 and 60 kn, six degrees of freedom. The book itself was not seen: the matrices
   were read in a public Python transcription of its tables (class Lynx, which has no more
   speeds). What can be checked of them was: gravity's and the Euler angles' elements agree with
   one attitude each to their last digit, and U_e, W_e with the speed.
2. P. Lopez-Adeva Fernandez-Layos, Simulador de Helicoptero, master's thesis, Universidad
   Politecnica de Madrid, 2006 (github.com/plafl/helisim, CC BY 4.0), sections 6.7 and 6.8: the same
   configuration in another program, with a finite-state wake. It prints curves; their points were
   read off the vector graphics of memoria.pdf, to about a two-hundredth of each figure's height.

Where both print a derivative they are as far apart as `apart` says: what one program says of this
helicopter is that uncertain. The configuration itself stands in models/lynx/parameters.toml.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from helisim.study.paper.values import Published

KNOT = 1852.0 / 3600.0
"""m/s."""
GRAVITY = 9.81
"""m/s^2, of the tables: their rows' elements are 9.81 cos(theta) and so on."""

STATES = ("u", "w", "q", "theta", "v", "p", "phi", "r")
INPUTS = ("theta_0", "theta_1s", "theta_1c", "theta_0T")

_A = {
    0: (
        (-0.0199, 0.0215, 0.6674, -9.7837, -0.0205, -0.1600, 0.0000, 0.0000),
        (0.0237, -0.3108, 0.0134, -0.7215, -0.0028, -0.0054, 0.5208, 0.0000),
        (0.0468, 0.0055, -1.8954, 0.0000, 0.0588, 0.4562, 0.0000, 0.0000),
        (0.0000, 0.0000, 0.9985, 0.0000, 0.0000, 0.0000, 0.0000, 0.0532),
        (0.0207, 0.0002, -0.1609, 0.0380, -0.0351, -0.6840, 9.7697, 0.0995),
        (0.3397, 0.0236, -2.6449, 0.0000, -0.2715, -10.976, 0.0000, -0.0203),
        (0.0000, 0.0000, -0.0039, 0.0000, 0.0000, 1.0000, 0.0000, 0.0737),
        (0.0609, 0.0089, -0.4766, 0.0000, -0.0137, -1.9367, 0.0000, -0.2743),
    ),
    20: (
        (-0.0082, 0.0254, -0.0685, -9.7868, -0.0158, -0.1480, 0.0000, 0.0000),
        (-0.1723, -0.4346, 10.4965, -0.6792, -0.0150, -0.1044, 0.4545, 0.0000),
        (0.0417, 0.0157, -2.0012, 0.0000, 0.0482, 0.4441, 0.0000, 0.0000),
        (0.0000, 0.0000, 0.9989, 0.0000, 0.0000, 0.0000, 0.0000, 0.0464),
        (0.0173, 0.0161, -0.1435, 0.0311, -0.0604, 0.0308, 9.77607, -10.1108),
        (0.1531, 0.2739, -2.4044, 0.0000, -0.2439, -10.9208, 0.0000, -0.0793),
        (0.0000, 0.0000, -0.0032, 0.0000, 0.0000, 1.0000, 0.0000, 0.0694),
        (0.0037, 0.0455, -0.3753, 0.0000, 0.0025, -1.9201, 0.0000, -0.4404),
    ),
    40: (
        (-0.0146, 0.0347, -0.5681, -9.7934, -0.0083, -0.1321, 0.0000, 0.0000),
        (-0.1186, -0.6156, 20.6855, -0.5779, -0.0180, -0.2022, 0.3519, 0.0000),
        (0.0319, 0.0212, -2.1033, 0.0000, 0.0277, 0.4210, 0.0000, 0.0000),
        (0.0000, 0.0000, 0.9994, 0.0000, 0.0000, 0.0000, 0.0000, 0.0359),
        (0.0070, 0.0184, -0.1303, 0.0205, -0.0915, 0.5342, 9.7869, -20.3077),
        (-0.0255, 0.3040, -2.1361, 0.0000, -0.1949, -10.7839, 0.0000, -0.1441),
        (0.0000, 0.0000, -0.0021, 0.0000, 0.0000, 1.0000, 0.0000, 0.0590),
        (-0.0325, 0.0314, -0.2522, 0.0000, 0.0316, -1.8857, 0.0000, -0.68597),
    ),
    60: (
        (-0.0243, 0.0392, -0.6705, -9.8014, -0.0041, -0.1190, 0.0000, 0.0000),
        (-0.0467, -0.7285, 30.8640, -0.4200, -0.0186, -0.3216, 0.3117, 0.0000),
        (0.0280, 0.0248, -2.2156, 0.0000, 0.0159, 0.4108, 0.0000, 0.0000),
        (0.0000, 0.0000, 0.9995, 0.0000, 0.0000, 0.0000, 0.0000, 0.0318),
        (0.0035, 0.0159, -0.1293, 0.0133, -0.1228, 0.6465, 9.7964, -30.5334),
        (-0.0437, 0.2611, -2.0532, 0.0000, -0.1713, -10.6565, 0.0000, -0.2069),
        (0.0000, 0.0000, -0.0014, 0.0000, 0.0000, 1.0000, 0.0000, 0.0429),
        (-0.0273, 0.0109, -0.1661, 0.0000, 0.0529, -1.8568, 0.0000, -0.9039),
    ),
}
_B = {
    0: (
        (6.9417, -9.2860, 2.0164, 0.0000),
        (-93.9179, -0.0020, -0.0003, 0.0000),
        (0.9554, 26.4011, -5.7326, 0.0000),
        (0.0000, 0.0000, 0.0000, 0.0000),
        (-0.3563, -2.0164, -9.2862, 3.6770),
        (7.0476, -33.2120, -152.9537, -0.7358),
        (0.0000, 0.0000, 0.0000, 0.0000),
        (17.3054, -5.9909, -27.5911, -9.9111),
    ),
    20: (
        (5.6326, -8.9083, 2.0273, 0.0000),
        (-89.9908, -6.0809, 0.0010, 0.0000),
        (3.8558, 26.6794, -5.7663, 0.0000),
        (0.0000, 0.0000, 0.0000, 0.0000),
        (0.1249, -2.0098, -9.3275, 3.4515),
        (13.2029, -32.8252, -153.5913, -0.6907),
        (0.0000, 0.0000, 0.0000, 0.0000),
        (16.5240, -5.9080, -27.5007, -9.3029),
    ),
    40: (
        (4.8686, -8.5123, 2.0305, 0.0000),
        (-95.5241, -12.7586, 0.0003, 0.0000),
        (7.2883, 27.0667, -5.7827, 0.0000),
        (0.0000, 0.0000, 0.0000, 0.0000),
        (1.1239, -1.8435, -9.3132, 3.3289),
        (27.3295, -30.1532, -153.4552, -0.6662),
        (0.0000, 0.0000, 0.0000, 0.0000),
        (15.9423, -5.8252, -27.2699, -8.9726),
    ),
    60: (
        (4.6289, -8.0560, 2.0386, 0.0000),
        (-107.3896, -21.2288, 0.0000, 0.0000),
        (10.7004, 27.6889, -5.8115, 0.0000),
        (0.0000, 0.0000, 0.0000, 0.0000),
        (1.4472, -1.6712, -9.3018, 3.7509),
        (31.4636, -27.4424, -153.3177, -0.7505),
        (0.0000, 0.0000, 0.0000, 0.0000),
        (14.5826, -5.9178, -27.0369, -10.1087),
    ),
}


@dataclass(frozen=True)
class LinearFlight:
    """Padfield's linear model of level flight at one speed.

    Attributes:
        knots: airspeed.
        a: rows of the state matrix, `STATES` by `STATES`.
        b: rows of the input matrix, `STATES` by `INPUTS`.
    """

    knots: int
    a: tuple[tuple[float, ...], ...]
    b: tuple[tuple[float, ...], ...]

    def derivative(self, rate: str, cause: str) -> float:
        """Return d(rate of a state)/d(state or input) by name, such as ("q", "u") for M_u."""
        row = STATES.index(rate)
        if cause in STATES:
            return self.a[row][STATES.index(cause)]
        return self.b[row][INPUTS.index(cause)]


PADFIELD: Mapping[int, LinearFlight] = MappingProxyType(
    {knots: LinearFlight(knots, _A[knots], _B[knots]) for knots in _A}
)
"""Airspeed, kn -> the linear model."""

THESIS_KNOTS = (0, 20, 40, 60, 80, 100, 120)
_TRIMS = {
    "theta_0": (0.2869, 0.2727, 0.2479, 0.2344, 0.2320, 0.2378, 0.2519),
    "theta_1s": (0.0105, -0.0057, -0.0179, -0.0276, -0.0373, -0.0481, -0.0617),
    "theta_1c": (0.0015, 0.0278, 0.0358, 0.0332, 0.0301, 0.0283, 0.0278),
    "theta_0T": (0.2782, 0.2455, 0.1768, 0.1260, 0.1029, 0.0966, 0.1014),
    "phi": (-0.0648, -0.0458, -0.0281, -0.0202, -0.0179, -0.0189, -0.0234),
    "theta": (0.0593, 0.0543, 0.0473, 0.0366, 0.0216, 0.0019, -0.0236),
    "lambda_0": (0.0659, 0.0563, 0.0389, 0.0273, 0.0207, 0.0167, 0.0141),
    "CT_T": (0.0184, 0.0162, 0.0123, 0.0101, 0.0094, 0.0097, 0.0110),
}
THESIS_TRIMS: Mapping[str, tuple[float, ...]] = MappingProxyType(_TRIMS)
"""Angles (rad), mean inflow ratio and thrust coefficient of the tail rotor at `THESIS_KNOTS`."""

_DERIVATIVES = {
    "X_u": (-0.0232, -0.0117, -0.0124, -0.0176, -0.0223, -0.0265, -0.0307),
    "X_w": (0.0167, 0.0178, 0.0218, 0.0244, 0.0257, 0.0283, 0.0327),
    "Z_u": (0.0125, -0.1824, -0.1424, -0.0704, -0.0320, -0.0132, -0.0051),
    "Z_w": (-0.2907, -0.3922, -0.5501, -0.6564, -0.7254, -0.7755, -0.8146),
    "M_u": (0.0568, 0.0429, 0.0268, 0.0209, 0.0184, 0.0168, 0.0159),
    "M_w": (-0.0021, 0.0142, 0.0248, 0.0281, 0.0325, 0.0396, 0.0472),
    "M_q": (-2.6099, -2.9395, -3.2752, -3.2256, -3.1160, -3.0385, -2.9906),
    "Y_v": (-0.0354, -0.0631, -0.0916, -0.1225, -0.1538, -0.1848, -0.2161),
    "L_v": (-0.3305, -0.2740, -0.1797, -0.1178, -0.0767, -0.0426, -0.0099),
    "L_p": (-14.9895, -14.6982, -12.7068, -11.3397, -10.7789, -10.4710, -10.2122),
    "L_q": (-0.6816, -0.0323, -0.1197, -0.7542, -1.1197, -1.3276, -1.4778),
    "M_p": (0.1189, 0.0141, 0.0271, 0.1421, 0.2184, 0.2719, 0.3176),
    "N_v": (-0.0229, 0.0088, 0.0540, 0.0960, 0.1313, 0.1627, 0.1915),
    "N_p": (-2.6510, -2.5920, -2.2191, -1.9658, -1.8633, -1.8092, -1.7650),
    "N_r": (-0.4657, -0.5690, -0.7102, -0.8790, -1.0336, -1.1694, -1.2891),
    "X_theta_1s": (-10.097, -9.618, -9.254, -9.013, -8.805, -8.645, -8.484),
    "Z_theta_0": (-87.86, -84.37, -88.86, -100.56, -111.37, -120.88, -129.67),
    "Z_theta_1s": (-0.71, -6.41, -12.59, -20.56, -29.41, -38.61, -47.94),
    "M_theta_0": (-1.41, 1.61, 5.43, 8.84, 12.01, 15.27, 18.64),
    "M_theta_1s": (25.608, 25.318, 25.728, 26.616, 27.507, 28.506, 29.665),
    "Y_theta_1c": (-10.122, -9.973, -9.826, -9.808, -9.826, -9.875, -9.982),
    "L_theta_0": (9.05, 10.89, 25.12, 31.91, 32.75, 32.54, 33.15),
    "L_theta_1s": (-42.05, -41.41, -33.84, -27.34, -23.59, -20.60, -17.32),
    "L_theta_1c": (-147.88, -146.58, -147.76, -150.02, -151.30, -152.16, -152.96),
    "N_theta_0": (19.88, 18.25, 17.58, 16.38, 15.10, 14.64, 15.61),
    "Y_theta_0T": (3.986, 3.754, 3.409, 3.651, 4.100, 4.503, 4.838),
    "N_theta_0T": (-10.910, -10.276, -9.331, -9.992, -11.222, -12.326, -13.241),
}
THESIS_DERIVATIVES: Mapping[str, tuple[float, ...]] = MappingProxyType(_DERIVATIVES)
"""Derivatives at `THESIS_KNOTS`; products of inertia are in those of L and N, as in the tables."""

PUBLISHED = Published({}, calibration=(), source="Padfield, see models/lynx/README.md")
"""None of helisim's own models is published of it, and nothing to calibrate it to."""

RATE_OF = {"X": "u", "Y": "v", "Z": "w", "L": "p", "M": "q", "N": "r"}
"""The state whose rate a force or moment's derivative is of."""


def apart(name: str, knots: int) -> float:
    """Return by how much of Padfield's value the thesis's is off it, where both print one.

    Raises:
        KeyError: one of them doesn't.
    """
    axis, _, cause = name.partition("_")
    printed = PADFIELD[knots].derivative(RATE_OF[axis], cause)
    return THESIS_DERIVATIVES[name][THESIS_KNOTS.index(knots)] / printed - 1.0
