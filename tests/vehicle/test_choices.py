"""Parameters that are a choice between words: the same in Python, in files, on the command line."""

import pytest

from command import fails
from helisim.base.errors import InputError, ModelError
from helisim.study.campaign import read_campaign
from helisim.vehicle import load, read_parameters, standard_parameters
from helisim.vehicle.parameters import glossary, number_of, to_toml, word_of
from own_vehicle import copied, edited

CHOICES = {name: known.words for name, known in glossary().items() if known.words}


@pytest.mark.parametrize("name", CHOICES)
def test_every_word_stands_for_a_number_and_back(name):
    """Also in a file, which is written with the word and read again."""
    for word in CHOICES[name]:
        assert word_of(name, number_of(name, word)) == word
        assert number_of(name, number_of(name, word)) == number_of(name, word)
        chosen = standard_parameters("jr700").replace({name: word})
        assert chosen.word(name) == word
        assert f'value = "{word}"' in to_toml(chosen, "header")


@pytest.mark.parametrize("value", ["perfect", "Ideal", 7, 0.5, True, None])
def test_another_word_is_refused_with_those_that_exist(value):
    """In one line."""
    with pytest.raises(InputError, match=r"^drive\.governor must be ideal.*, got "):
        load(parameters={"drive.governor": value})


def test_a_word_where_a_number_is_expected_is_refused():
    """In place of a traceback."""
    with pytest.raises(InputError, match=r"'air\.density' must be a finite number, got 'thin'"):
        load(parameters={"air.density": "thin"})


def test_a_file_may_say_the_word(tmp_path, capsys):
    """A wrong one is refused with the file's name."""
    own = copied(tmp_path / "own")
    file, there = own / "parameters.toml", 'governor = { value = "ideal"'
    assert read_parameters(file).word("drive.governor") == "ideal"
    edited(own, file.name, there, 'governor = { value = "motor"')
    assert read_parameters(file).word("drive.governor") == "motor"
    edited(own, file.name, 'governor = { value = "motor"', 'governor = { value = "perfect"')
    with pytest.raises(ModelError, match=r"parameters\.toml: drive\.governor must be ideal"):
        read_parameters(file)
    assert "drive.governor must be ideal or motor, got 'perfect'" in fails(capsys, "trim", own)


def test_the_command_line_takes_the_word(capsys):
    """And refuses another in one line."""
    said = fails(capsys, "trim", "--set", "drive.governor=perfect")
    assert "--set drive.governor must be ideal" in said
    assert "'perfect'" in said
    assert "--set takes NAME=VALUE with a number" in fails(capsys, "trim", "--set", "air.density=x")


def test_a_campaign_takes_the_words(tmp_path):
    """Set or varied, like a number."""
    file = tmp_path / "campaign.toml"
    file.write_text('[vary.vehicle]\n"drive.governor" = ["ideal", "motor"]\n')
    settings = [one.settings.parameters() for one in read_campaign(file)]
    assert settings == [{"drive.governor": 0.0}, {"drive.governor": 1.0}]
    file.write_text('[set.vehicle]\n"drive.governor" = "perfect"\n')
    with pytest.raises(InputError, match=r"drive\.governor must be ideal or motor"):
        read_campaign(file)
