import difflib
import random
import string

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mjplug.errors import UnknownName, did_you_mean
from mjplug.near_names import MAX_NAME_LENGTH, Names

MANY = Names(f"{room}_{part}_{k}" for room in ("kitchen", "hall") for part in ("cup", "plate") for k in range(5000))


@pytest.mark.parametrize(
    ("wrong", "right"),
    [
        ("kitchen_cup_123x", "kitchen_cup_123"),
        ("kichen_cup_1234", "kitchen_cup_1234"),
        ("itchen_plate_77", "kitchen_plate_77"),
        ("hlal_plate_4999", "hall_plate_4999"),
        ("Kitchen_Cup_42", "kitchen_cup_42"),
        ("hall_cup42", "hall_cup_42"),
    ],
)
def test_among_twenty_thousand_names_one_mistake_finds_the_right_one(wrong, right):
    assert MANY.nearest(wrong) == right


@pytest.mark.parametrize("wrong", ["", "zzz", "\0", "q" * MAX_NAME_LENGTH, "kitchen_cup_1" * 100])
def test_what_is_like_no_name_finds_none(wrong):
    assert MANY.nearest(wrong) is None


def test_several_mistakes_find_the_name_that_difflib_finds():
    names = ["shoulder_joint", "elbow_joint", "wrist_roll", "base_link", "tool0"]
    for wrong in ("sholder_jont", "elbw_jiont", "wirst_rol", "bse_lnik", "tol0"):
        assert Names(names).nearest(wrong) == difflib.get_close_matches(wrong, names, n=1)[0]


@given(st.lists(st.text(max_size=20), max_size=30), st.text(max_size=120))
def test_any_names_and_any_wrong_name_give_a_name_or_none(names, wrong):
    assert Names(names).nearest(wrong) in {*names, None} - {""}


def test_a_wrong_name_takes_as_much_work_among_many_names_as_among_few(monkeypatch):
    """What is counted is comparisons, since time depends on the machine."""
    from mjplug import near_names

    compared = []
    alike = near_names._similarity
    monkeypatch.setattr(near_names, "_similarity", lambda a, b: compared.append(b) or alike(a, b))
    letters = random.Random(1)
    for _ in range(100):
        wrong = "kitchen_" + "".join(letters.choices(string.ascii_lowercase + "_0123456789", k=80))
        compared.clear()
        UnknownName("body", wrong, MANY)
        assert len(compared) <= 48


def test_the_sentence_has_the_near_name_and_the_first_of_the_others():
    assert did_you_mean("kichen_cup_1", MANY) == ", did you mean 'kitchen_cup_1'?"
    sentence = str(UnknownName("body", "kichen_cup_1", MANY))
    assert sentence.startswith(
        "unknown body 'kichen_cup_1', did you mean 'kitchen_cup_1'?; known: hall_cup_0, hall_cup_1,"
    )
    assert sentence.endswith(", … (20000 in all)")
