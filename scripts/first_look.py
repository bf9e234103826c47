"""Identify roll and pitch from the recorded logs that come with helisim, and draw what was found.

python scripts/first_look.py [FOLDER]
"""

import sys
from pathlib import Path

import helisim as hs


def main(folder: Path) -> None:
    """Print the model and how well it predicts; write the figures as PNG into the folder."""
    sweeps = [hs.open_example("sweep_lat"), hs.open_example("sweep_lon")]
    frf = hs.frequency_response(
        sweeps,
        inputs=("lat", "lon"),
        outputs=("p", "q"),
        conditioning=("col", "ped"),
        band=(3.0, 42.0),
    )
    fit = hs.identify(frf, hs.structures.rollpitch)
    verification = hs.verify(fit, hs.open_example("doublet_lat"))
    print(fit)
    print(verification)
    figures = {
        "flight": sweeps[0].plot(),
        "response": frf.plot("p/lat"),
        "fit": fit.plot(),
        "verification": verification.plot(),
    }
    for name, figure in figures.items():
        figure.savefig(folder / f"{name}.png", dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path())
