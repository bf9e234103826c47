"""Draw the window in which a hand flies, for its page: by_hand.png beside this file.

Run with a display: xvfb-run -a -s "-screen 0 1280x900x24" python scripts/pictures/by_hand.py
"""

from pathlib import Path

from matplotlib.image import imsave

import helisim as hs
from helisim.hand import Deflection, HandFlight, Sticks
from helisim.hand.window import Cockpit, GlfwWindow
from helisim.show.viewer import Rotors

_HERE = Path(__file__).parent


def main() -> None:
    flight = HandFlight(hs.load("jr700"))
    cockpit = Cockpit(flight, Sticks(), _HERE / "by_hand.parquet")
    flight.start_recording()
    flight.fly(2.6, lon=-0.6, lat=0.3)
    flight.deflection = Deflection(lon=-0.6, lat=0.3, ped=0.25)
    flight.fly(0.4)
    with GlfwWindow(flight, size=(960, 640)) as window:
        Rotors(flight.model).draw(flight.data)
        window.show(*cockpit.words())
        imsave(_HERE / "by_hand.png", window.picture())


if __name__ == "__main__":
    main()
