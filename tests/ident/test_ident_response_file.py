"""Frequency responses in files: helisim's own to the last bit, others' by what their headings say.

The others' are written here from a textbook's closed form: b / (s^2 + 2 zeta w0 s + w0^2).
"""

import hashlib
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helisim.base.errors import InputError, StorageError
from helisim.ident import FrequencyResponse, frequency_response, identify, load_response, structures
from helisim.ident.response import is_response
from helisim.records.record import FlightRecord, channel
from swept_logs import HEAVE, flown

OMEGA = np.geomspace(0.5, 20.0, 40)
ZETA, W0, GAIN = 0.3, 4.0, 8.0
EXACT = GAIN / (W0**2 - OMEGA**2 + 2j * ZETA * W0 * OMEGA)
COHERENCE = np.linspace(0.99, 0.7, OMEGA.size)
DB, DEG = 20.0 * np.log10(np.abs(EXACT)), np.degrees(np.unwrap(np.angle(EXACT)))


@pytest.fixture(scope="module")
def heave():
    time, inputs, outputs = flown(structures.heave, HEAVE, "col", 5, duration=30.0, noise=0.02)
    record = FlightRecord(time, np.hstack([inputs, outputs]), (channel("col"), channel("w")))
    return frequency_response(record, inputs="col", outputs="w", band=(2.0, 20.0))


def written(path, heading, columns, separator=","):
    """Write columns as another program does."""
    lines = [heading] if heading else []
    lines += [separator.join(f"{cell:.12g}" for cell in row) for row in zip(*columns)]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_response_in_json_gives_the_fit_of_its_records(tmp_path, heave):
    """Values and standard errors are the same to the last bit: nothing is estimated twice."""
    path = tmp_path / "heave.json"
    heave.save(path)
    again = load_response(path)
    assert again == heave
    assert again.scatter == heave.scatter
    assert not again.scatter.noise.flags.writeable
    one, other = (identify(frf, structures.heave) for frf in (heave, again))
    assert one.values == other.values
    for name in one.parameters:
        assert one[name].standard_error == other[name].standard_error, name


def test_a_response_in_csv_keeps_all_but_the_error_model(tmp_path, heave):
    """Text for other programs holds names, units and quality; the fit says what is missing."""
    path = tmp_path / "heave.csv"
    heave.save(path)
    again = load_response(path)
    assert again.response == pytest.approx(heave.response, rel=1e-12)
    for name in ("frequency", "coherence", "random_error"):
        assert np.array_equal(getattr(again, name), getattr(heave, name)), name
    for name in ("inputs", "outputs", "input_units", "output_units", "windows", "sources"):
        assert getattr(again, name) == getattr(heave, name), name
    assert "no error model" in " ".join(identify(again, structures.heave).remarks)


@pytest.mark.parametrize(
    ("heading", "columns", "separator"),
    [
        ("frequency [Hz],magnitude [dB],phase [deg]", (OMEGA / (2 * np.pi), DB, DEG), ","),
        ("w (rad/s);Gain (abs);Phase (rad)", (OMEGA, abs(EXACT), np.angle(EXACT)), ";"),
        ("% omega_rad_s mag_dB phase_deg", (OMEGA, DB, DEG), " "),
        ("# freq (Hz)\tReal\tImag", (OMEGA / (2 * np.pi), EXACT.real, EXACT.imag), "\t"),
        ("freqHz magDB phaseDeg", (OMEGA / (2 * np.pi), DB, DEG + 360.0), "  "),
        ('"x","phase [deg]","freq [rad/s]","dB"', (0 * OMEGA, DEG, OMEGA, DB), ","),
    ],
)
def test_anyones_columns_are_read_by_their_headings(tmp_path, heading, columns, separator):
    """Order, separators, units and notations differ; the response is the textbook's."""
    path = written(tmp_path / "other.txt", heading, columns, separator)
    assert is_response(path)
    found = load_response(path, unnamed="q/lon")
    assert (found.outputs, found.inputs) == (("q",), ("lon",))
    assert found.frequency == pytest.approx(OMEGA, rel=1e-9)
    assert found.response[0, 0] == pytest.approx(EXACT, rel=1e-9)


def test_columns_without_headings_are_named_by_the_caller(tmp_path):
    """CIFER's and MATLAB's tables have none: the order is told, and a unit is never guessed."""
    path = written(tmp_path / "bare.txt", "", (OMEGA, DB, DEG, COHERENCE, OMEGA), " ")
    columns = "frequency:rad/s,magnitude:dB,phase:deg,coherence,-"
    found = load_response(path, columns=columns, unnamed="p/lat")
    assert found.response[0, 0] == pytest.approx(EXACT, rel=1e-9)
    assert found.coherence[0, 0] == pytest.approx(COHERENCE)
    assert not is_response(path)
    with pytest.raises(InputError, match=r"bare\.txt.*no headings.*columns='freq"):
        load_response(path, unnamed="p/lat")


def test_what_a_file_lacks_is_told_with_what_is_assumed(tmp_path):
    """Coherence counts as 1, the random error as that of one average: it is among the flags."""
    path = written(tmp_path / "bare.csv", "f [rad/s],mag [dB],phase [deg]", (OMEGA, DB, DEG))
    told = " ".join(load_response(path, unnamed="p/lat").flags)
    assert "magnitude in dB" in told
    assert "no coherence of p/lat: it is taken as 1" in told
    assert "no random error of p/lat" in told
    with_coherence = written(
        tmp_path / "some.csv",
        "f [rad/s],mag [dB],phase [deg],coherence",
        (OMEGA[:2], DB[:2], DEG[:2], np.array([0.5, 0.8])),
    )
    # Bendat and Piersol: sqrt((1 - g2) / (2 g2 n)), of n = 1 average
    implied = load_response(with_coherence, unnamed="p/lat").random_error[0, 0]
    assert implied == pytest.approx([0.70710678, 0.35355339])
    full = written(
        tmp_path / "full.csv",
        "f [rad/s],mag [dB],phase [deg],coherence,random error [%]",
        (OMEGA, DB, DEG, COHERENCE, 100.0 * (1.0 - COHERENCE)),
    )
    found = load_response(full, unnamed="p/lat")
    assert found.random_error[0, 0] == pytest.approx(1.0 - COHERENCE)
    assert "is taken" not in " ".join(found.flags)


def test_a_textbook_response_gives_its_damping_and_frequency(tmp_path):
    """The parameters of the closed form come back from a file that another program wrote."""
    path = written(tmp_path / "o.csv", "f [rad/s],mag [dB],phase [deg]", (OMEGA, DB, DEG))
    structure = structures.transfer_function(zeros=0, poles=2, input="lat", output="p")
    fit = identify(load_response(path, unnamed="p/lat"), structure)
    wanted = {"b0": GAIN, "a1": 2.0 * ZETA * W0, "a0": W0**2}
    for name, value in wanted.items():  # the file has 12 digits
        assert fit[name].value == pytest.approx(value, rel=1e-6), name


def test_responses_of_several_files_are_one(tmp_path):
    """Each is used at its own frequencies; elsewhere, and where there is none, not at all."""
    one = written(tmp_path / "1.csv", "f [rad/s],mag [dB],phase [deg]", (OMEGA, DB, DEG))
    some = slice(10, 30)
    other = written(
        tmp_path / "2.csv", "f [rad/s],mag [dB],phase [deg]", (OMEGA[some], DB[some], DEG[some])
    )
    found = load_response({"p/lat": one, "q/lon": other})
    assert found.frequency == pytest.approx(OMEGA)
    assert found.pairs == ("p/lat", "p/lon", "q/lat", "q/lon")
    usable = found.usable()
    assert np.all(usable[0, 0])
    assert np.flatnonzero(usable[1, 1]).tolist() == list(range(10, 30))
    assert not np.any(usable[0, 1])
    assert found.response[1, 1, some] == pytest.approx(EXACT[some], rel=1e-9)
    assert "not measured at 20 of the 40" in " ".join(found.flags)


@pytest.mark.slow
@given(st.lists(st.tuples(st.integers(0, 10**6), st.binary(max_size=6)), min_size=1, max_size=6))
@settings(max_examples=60, deadline=None)
def test_any_damage_is_a_response_or_a_refusal(tmp_path_factory, heave, damage):
    """Whatever a disk or an editor did to a file, it ends in a message that names it."""
    folder = tmp_path_factory.mktemp("damage")
    for end in (".json", ".csv"):
        path = folder / f"heave{end}"
        heave.save(path)
        data = bytearray(path.read_bytes())
        for place, bytes_ in damage:
            data[place % len(data) : place % len(data) + len(bytes_)] = bytes_
        path.write_bytes(data)
        message = ""
        try:
            load_response(path)
        except (InputError, StorageError) as error:
            message = str(error)
        assert not message or str(path) in message


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("f [Hz],mag,phase [deg]\n1,2,3\n2,3,4\n", "'mag' has no unit"),
        ("freq,mag [dB],phase [deg]\n1,2,3\n2,3,4\n", "'freq' has no unit"),
        ("f [Hz],mag [dB]\n1,2\n2,3\n", "expected magnitude and phase"),
        ("f [Hz],mag [dB],phase [deg]\n1,2,3\n1,3,4\n", "repeat"),
        ("f [Hz],mag [dB],phase [deg]\n1,2,3\n2,x,4\n", "line 3: 'x' isn't a number"),
        ("f [Hz],mag [dB],phase [deg]\n1,2,3\n2,3\n", "line 3 has 2 cells"),
        ("f [Hz],mag [dB],phase [deg]\n1,2,3\n2,nan,1\n", "isn't finite"),
        ("f [Hz],mag [dB],phase [deg]\n1,2,3\n", "1 lines of numbers"),
        ("f [Hz],mag [dB],phase [deg],coherence\n1,2,3,1\n2,3,4,2\n", "isn't from 0 to 1"),
        ("f [Hz],mag [dB],phase [deg],err\n1,2,3,1\n2,3,4,-2\n", "negative"),
        ("f [Hz],abs [abs],gain [1],phase [deg]\n1,2,0,1\n2,3,1,1\n", "is zero"),
        ("", "no headings"),
    ],
)
def test_a_text_that_is_no_response_is_refused(tmp_path, text, says):
    """The message names the file and what to do."""
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=rf"bad\.csv: .*{says}"):
        load_response(path, unnamed="p/lat")


def test_a_changed_file_is_refused(tmp_path, heave):
    """A response that was edited has lost its error model; the message says how to go on."""
    path = tmp_path / "heave.json"
    heave.save(path)
    data = json.loads(path.read_text())
    for part in (data["response"]["response"]["real"][0][0], data["scatter"]["model"]["weights"]):
        part[3], whole = part[4], part[3]
        path.write_text(json.dumps(data))
        with pytest.raises(InputError, match=r"heave\.json: .*take 'scatter' out"):
            load_response(path)
        part[3] = whole
    del data["scatter"]
    path.write_text(json.dumps(data))
    assert load_response(path).scatter is None
    for text in ("{", "[]", '{"format": "other"}', '{"format": 3, "response": []}'):
        path.write_text(text)
        with pytest.raises((InputError, StorageError), match=r"heave\.json"):
            load_response(path)
    with pytest.raises(StorageError, match=r"available: \.json, \.csv"):
        heave.save(tmp_path / "heave.txt")


def test_a_log_is_no_response(tmp_path):
    """A log's headings have no magnitude and phase beside a frequency."""
    path = written(tmp_path / "log.csv", "t [s],w [m/s],phase [deg]", (OMEGA, DB, DEG))
    assert not is_response(path)
    assert not is_response(tmp_path / "none.txt")
    assert not is_response("no\0name.txt")


def redigested(data):
    """Return a file's data with the digest that belongs to them."""
    response = FrequencyResponse.from_dict(data["response"]).response
    digest = hashlib.blake2b(response.tobytes(), digest_size=12)

    def parts(plain):
        match plain:
            case dict():
                return "".join(f"{name}:{parts(plain[name])}" for name in sorted(plain))
            case list():
                return f"[{len(plain)}" + "".join(map(parts, plain))
        return f"{plain!r};"

    digest.update(parts(data["scatter"]["model"]).encode())
    data["scatter"]["digest"] = digest.hexdigest()
    return data


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: m["bias"].update(base64="AAAA*AAAA"), "can't be read|isn't base64"),
        (lambda m: m["bias"].update(base64="AAA"), "an array isn't base64"),
        (lambda m: m["bias"].update(type="<f2"), "has the type '<f2', expected <f8, <f4"),
        (lambda m: m["bias"].update(type="|O"), r"has the type '\|O', expected <f8"),
        (lambda m: m["bias"].update(shape=[7]), "can't be read: cannot reshape"),
        (lambda m: m.update(kind="object"), "can't be read: 'object'"),
        (lambda m: m.pop("share"), "can't be read: .*'share'"),
        (lambda m: m.update(more=1), "can't be read: .*'more'"),
    ],
)
def test_what_is_no_error_model_is_refused(tmp_path, heave, change, message):
    """Though its digest is right: nothing is guessed, no object is built."""
    path = tmp_path / "heave.json"
    heave.save(path)
    data = json.loads(path.read_text())
    path.write_text(json.dumps(redigested(data)))
    assert load_response(path).scatter == heave.scatter
    change(data["scatter"]["model"])
    path.write_text(json.dumps(redigested(data)))
    with pytest.raises(InputError, match=message):
        load_response(path)
