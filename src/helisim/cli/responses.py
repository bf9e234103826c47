"""Options and steps that the commands share which estimate frequency responses."""

import argparse
import warnings
from collections.abc import Callable, Sequence
from math import pi
from typing import TYPE_CHECKING, Any, NamedTuple

from helisim.base.errors import IdentificationError, InputError
from helisim.cli.bands import Band, Bands
from helisim.cli.common import names, numbers
from helisim.cli.logs import located, read_logs

if TYPE_CHECKING:
    from helisim.ident import FrequencyResponse
    from helisim.logs import Log
    from helisim.records.record import FlightRecord

_SAMPLES_A_PERIOD = 10.0
"""The default band ends where a period still has so many samples."""


class Signals(NamedTuple):
    """Which channels play which part."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    conditioning: tuple[str, ...]
    reference: tuple[str, ...]

    @classmethod
    def of(cls, options: argparse.Namespace) -> "Signals":
        """Return what the options say."""
        texts = (options.inputs, options.outputs, options.conditioning, options.reference)
        return cls(*(names(text) for text in texts))


class Estimated(NamedTuple):
    """Logs as they were read, their records, and the frequency response of all together.

    `band` is that of a response for which --band says nothing, rad/s.
    """

    logs: "tuple[Log, ...]"
    records: "tuple[FlightRecord, ...]"
    response: "FrequencyResponse"
    band: Band


def add_responses(command: argparse.ArgumentParser, *, required: bool) -> None:
    """Add the options of which responses are estimated and how."""
    default = "" if required else " (default: the structure's)"
    group = command.add_argument_group("how frequency responses are estimated")
    group.add_argument(
        "--inputs",
        required=required,
        metavar="A,B",
        help=f"channels that drive the vehicle{default}",
    )
    group.add_argument(
        "--outputs",
        required=required,
        metavar="P,Q",
        help=f"channels that answer, such as rates{default}",
    )
    group.add_argument(
        "--conditioning",
        metavar="C,D",
        help="further inputs that moved too: their effect is taken out",
    )
    group.add_argument(
        "--reference",
        metavar="A,B",
        help="signals outside the loop, such as the sticks: joint input-output method, which "
        "feedback and gusts don't bias",
    )
    own = "" if required else "; p/lat=LO:HI for one response, separated by commas"
    group.add_argument(
        "--band",
        action="append",
        default=[],
        metavar="LO HI",
        help=f"lowest and highest frequency, rad/s (default: what the records resolve){own}",
    )
    group.add_argument(
        "--estimator",
        choices=("windows", "local"),
        help="local: a polynomial or rational function in each narrow band, which no window "
        "smears and no transient biases (default); windows: CIFER's composite of Hann windows",
    )
    group.add_argument(
        "--windows",
        metavar="S,S,...",
        help="CIFER's windows with these lengths, s: long ones for low frequencies, short ones "
        "for less scatter (with --estimator windows alone five, by the band and the records)",
    )
    group.add_argument(
        "--overlap",
        type=float,
        metavar="SHARE",
        help="with windows: of a window that the next one covers (default: 0.75)",
    )


def estimator_options(options: argparse.Namespace) -> dict[str, Any]:
    """Return which estimator is asked for, and how. Raises InputError."""
    asked: dict[str, Any] = {"estimator": options.estimator}
    if options.windows is not None:
        asked["windows"] = numbers("--windows", options.windows)
    if options.overlap is not None:
        if options.estimator == "local":
            raise InputError("--overlap is of windows, and --estimator local has none")
        asked |= {"estimator": "windows", "overlap": options.overlap}
    return asked


def estimate(
    options: argparse.Namespace, signals: Signals, advance: Callable[[str], None]
) -> Estimated:
    """Read the logs and estimate their frequency response; the response's flags say what to doubt.

    Raises:
        HelisimError: a log can't be used; the message names the file.
    """
    from helisim.ident import CrossControlWarning, RecordQualityWarning, frequency_response

    inputs, outputs, conditioning, reference = signals
    wanted = tuple(dict.fromkeys((*inputs, *conditioning, *reference, *outputs)))
    with warnings.catch_warnings():
        for category in (CrossControlWarning, RecordQualityWarning):  # they are among the flags
            warnings.simplefilter("ignore", category)
        logs, records = read_logs(options, wanted, advance, moving=True)
        bands = Bands.of(options)
        common = bands.common or resolved_band(records)
        with located(logs):
            response = frequency_response(
                records,
                inputs=inputs,
                outputs=outputs,
                band=bands.around(common),
                conditioning=conditioning,
                reference=reference,
                **estimator_options(options),
                use_ended=options.use_ended,
            )
        advance("frequency responses")
    return Estimated(logs, records, response, common)


def resolved_band(records: "Sequence[FlightRecord]") -> Band:
    """Return the band that records resolve, rad/s.

    From one period in the longest window that the rules allow to ten samples a period.
    """
    durations = [record.duration for record in records]
    window = min(min(durations) / 2.0, sum(durations) / 5.0)
    low = 1.0001 * 2.0 * pi / window
    high = 2.0 * pi / (_SAMPLES_A_PERIOD * max(record.sample_time for record in records))
    if not low < high:
        raise IdentificationError(
            f"the records are too short: the shortest lasts {min(durations):.4g} s, which "
            f"resolves frequencies from {low:.4g} rad/s, and its samples up to {high:.4g} rad/s"
        )
    return low, high
