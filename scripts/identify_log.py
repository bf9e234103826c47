"""Identify the yaw model from records on disk: python scripts/identify_log.py ped_*.parquet."""

import sys

import helisim as hs


def main(paths: list[str]) -> None:
    """Print yaw damping, control power and delay with their bounds."""
    flights = [hs.read_record(path) for path in paths]
    frf = hs.frequency_response(
        flights,
        inputs="ped",
        outputs="r",
        conditioning=("v", "col"),
        reference=("PED", "LAT", "COL"),
        band=(0.6, 25.0),
    )
    print(hs.identify(frf, hs.structures.yaw_base))


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit("usage: python scripts/identify_log.py RECORD...")
    main(sys.argv[1:])
