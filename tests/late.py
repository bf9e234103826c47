"""A structure with delays of inputs and outputs, and a tie between its parameters."""

from helisim.ident import Parameter, Structure

LATE = Structure(
    name="late",
    parameters=(
        *(Parameter("a", "1/s", -1.5), Parameter("b", "1", 3.0), Parameter("tau_in", "s", 0.04)),
        *(Parameter("tau_p", "s", 0.03), Parameter("tau_q", "s", -0.02)),
    ),
    states=("p", "q"),
    inputs=("lat", "lon"),
    outputs=("p", "q"),
    F=(("a", "0.4"), ("0", "2*a")),
    G=(("b", "0"), ("1", "b")),
    input_delays={"lat": "tau_in"},
    output_delays={"p": "tau_p", "q": "tau_q"},
)
