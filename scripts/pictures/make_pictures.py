"""Make the READMEs' pictures: the models, a Bode figure, a screenshot of a Rerun recording.

    python scripts/pictures/make_pictures.py [DIR]

DIR is the folder of a run; without it one is flown. Off-screen pictures need a graphics stack
(Debian: apt-get install libegl1 libgl1 mesa-vulkan-drivers).
"""

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image
from rerun.experimental import ViewerClient

import helisim as hs
from helisim.show.canvas import to_png
from helisim.show.plots import draw_pair, pairs_of
from helisim.show.recording import write_recording
from helisim.study.results import Run, read_run
from helisim.vehicle.folder import model_folder, vehicle_names

PICTURES = Path(__file__).parent
PATIENCE = 60.0  # s to wait for the viewer.
NOTICES = 8.0  # s until the viewer's notices have faded.
TITLE_BAR = 36  # px at the top of the viewer, which are about this computer and not the recording.


def main() -> None:
    """Write all pictures."""
    with tempfile.TemporaryDirectory() as folder:
        if len(sys.argv) > 1:
            run_folder = Path(sys.argv[1])
        else:
            run_folder = Path(folder)
            hs.reproduce(out=run_folder)
        write_models()
        write_bode(read_run(run_folder), PICTURES / "bode.png")
        sweep = fly_sweep()
        recording = write_recording(
            Path(folder) / "lat.rrd", {"lateral sweep": sweep}, model=hs.load().visual_model()
        )
        most = sweep.time[np.argmax(np.abs(sweep["b"]))]  # the disc's largest tilt to a side
        write_screenshot(recording, PICTURES / "recording.png", seconds=float(most))


def write_models() -> None:
    """Render each vehicle as MuJoCo sees it."""
    environment = {"MUJOCO_GL": "egl", **os.environ}
    for name in vehicle_names():
        folder = model_folder(name)
        subprocess.run(
            [sys.executable, folder / "build.py", "picture"], env=environment, check=True
        )
        print(f"Written: {folder / f'{name}.png'}")


def write_bode(run: Run, path: Path) -> None:
    """Put p/lat and q/lon of the roll-pitch model side by side."""
    (item,) = (item for item in run.models if item.name == "rollpitch_in1")
    drawings = {
        drawing.name.split("_", 3)[3]: drawing
        for drawing in (draw_pair(item, *pair) for pair in pairs_of(item.fit))
    }
    pictures = [Image.open(BytesIO(to_png(drawings[pair]))) for pair in ("p_lat", "q_lon")]
    both = Image.new("RGB", (sum(p.width for p in pictures), pictures[0].height), "white")
    for k, picture in enumerate(pictures):
        both.paste(picture, (k * pictures[0].width, 0))
    both.quantize(128).save(path, optimize=True)
    print(f"Written: {path}")


def fly_sweep() -> hs.FlightRecord:
    """Fly a lateral sweep, recorded with the rotor's true tilt and loads."""
    vehicle = hs.load("jr700")
    recorder = hs.Recorder.of(vehicle, rotor=True)
    (record,) = hs.fly(
        vehicle, hs.FlightPlan(excitation=hs.Sweep(axis="lat"), recorder=recorder), seed=1
    )
    return record


def write_screenshot(recording: Path, path: Path, *, seconds: float) -> None:
    """Open a recording in Rerun's headless viewer, go to a time, and take a picture."""
    with viewer(recording) as client:
        until = time.monotonic() + PATIENCE
        while client.get_state().loading or not client.get_state().views:
            if time.monotonic() > until:
                raise SystemExit(f"the viewer has not loaded {recording} in {PATIENCE:g} s")
            time.sleep(0.5)
        client.set_time("time", duration=seconds, play_state="paused")
        time.sleep(NOTICES)
        before, picture = b"", client.take_screenshot()
        while picture != before:  # until nothing moves any more
            time.sleep(1.0)
            before, picture = picture, client.take_screenshot()
        shown = Image.open(BytesIO(picture)).convert("RGB")
        shown = shown.crop((0, TITLE_BAR, *shown.size))
        shown.quantize(192).save(path, optimize=True)
    print(f"Written: {path}")


@contextmanager
def viewer(recording: Path) -> Iterator[ViewerClient]:
    """Lend a headless viewer that listens to this computer alone."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = ["rerun", "--headless", "--bind", "127.0.0.1", "--port", str(port)]
    command += ["--window-size", "1600x1000", "--hide-welcome-screen", str(recording)]
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    try:
        yield _connected(f"rerun+http://127.0.0.1:{port}/proxy", process)
    finally:
        os.killpg(process.pid, signal.SIGTERM)
        process.wait()


def _connected(url: str, process: subprocess.Popen) -> ViewerClient:
    until = time.monotonic() + PATIENCE
    while process.poll() is None and time.monotonic() < until:
        try:
            client = ViewerClient.connect(url)
            client.get_state()
            return client
        except (ConnectionError, RuntimeError):
            time.sleep(0.5)
    raise SystemExit(
        "Rerun's headless viewer doesn't start; without a graphics card it needs "
        "mesa-vulkan-drivers"
    )


if __name__ == "__main__":
    main()
