"""Settings of any system: what is accepted, what is refused in which words, YAML, hashes; and that every field is explained."""

from __future__ import annotations

import ast
import inspect
from dataclasses import FrozenInstanceError, dataclass, field, fields
from typing import Annotated, ClassVar, Literal

import pytest

from mwlib.prediction.config import Config
from mwlib.settings import BelowOne, Count, Natural, NotNegative, OneOf, Positive, Settings, Share, parse_changes, read_yaml


@dataclass(frozen=True)
class Kitchen:
    """A group."""

    plates: Count = 4
    guests: Natural = 0
    heat: Positive = 180.0
    salt: Share = 0.5
    sugar: BelowOne = 0.25
    minutes: NotNegative = 30.0
    offset: float = -1.0
    is_open: bool = True
    cook: str = "anna"
    dish: Literal["soup", "stew"] = "soup"
    pan: Annotated[str, OneOf(("iron", "steel"))] = "iron"
    times: tuple[int, ...] = (1, 2)
    names: tuple[str, ...] = ()


@dataclass(frozen=True)
class Table:
    """Another."""

    legs: int = 4
    lamp: bool = False


@dataclass(frozen=True)
class House(Settings):
    """A system's settings."""

    system: ClassVar[str] = "house"
    presets: ClassVar = {"small": {"plates": 2, "legs": 3}}
    renamed: ClassVar = {"warmth": "heat"}
    after_training: ClassVar[frozenset[str]] = frozenset({"table", "minutes"})

    kitchen: Kitchen = field(default_factory=Kitchen)
    table: Table = field(default_factory=Table)

    def check(self) -> None:
        """Refuse a stew in less than an hour."""
        if self.kitchen.dish == "stew" and self.kitchen.minutes < 60:
            raise ValueError(f"minutes is {self.kitchen.minutes}; expected at least 60 for a stew")


def test_fields_are_changed_without_their_groups():
    house = House().override(plates=6, lamp=True)
    assert (house.kitchen.plates, house.table.lamp) == (6, True) and House().kitchen.plates == 4
    assert House.preset("small", legs=5) == House().override(plates=2, legs=5)
    assert house.get("plates") == 6 and house.get_group("table") == Table(4, True)
    assert house.changed_from(House()) == {"plates": 6, "lamp": True}
    assert House.owners()["heat"] == "kitchen" and list(House.groups()) == ["kitchen", "table"]
    with pytest.raises(FrozenInstanceError):
        house.kitchen.plates = 7


@pytest.mark.parametrize(
    "name, written, value",
    [
        ("heat", "1e-3", 1e-3),
        ("heat", "250", 250.0),
        ("heat", 200, 200.0),
        ("plates", 4e3, 4000),
        ("plates", "4e3", 4000),
        ("offset", "-2", -2.0),
        ("times", [3, 4.0, "5"], (3, 4, 5)),
        ("times", [], ()),
        ("names", ["S9", 11], ("S9", "11")),
        ("is_open", False, False),
        ("pan", "steel", "steel"),
        ("sugar", 0, 0.0),
    ],
)
def test_values_are_taken_as_people_write_them(name, written, value):
    found = House().override(**{name: written}).get(name)
    assert found == value and type(found) is type(value)


@pytest.mark.parametrize(
    "changes, message",
    [
        (dict(plates=True), "plates is True; expected a whole number"),
        (dict(plates=2.5), "plates is 2.5; expected a whole number"),
        (dict(plates="two"), "plates is 'two'; expected a whole number"),
        (dict(plates=0), "plates is 0; expected at least 1"),
        (dict(guests=-1), "guests is -1; expected at least 0"),
        (dict(heat=0), "heat is 0.0; expected more than 0"),
        (dict(heat="hot"), "heat is 'hot'; expected a finite number"),
        (dict(heat=float("nan")), "heat is 'nan'; expected a finite number"),
        (dict(heat="inf"), "heat is 'inf'; expected a finite number"),
        (dict(heat=None), "heat is None; expected a finite number"),
        (dict(offset=False), "offset is False; expected a finite number"),
        (dict(salt=1.5), "salt is 1.5; expected 0 to 1"),
        (dict(sugar=1), "sugar is 1.0; expected 0 to below 1"),
        (dict(minutes=-0.5), "minutes is -0.5; expected at least 0"),
        (dict(is_open=1), "is_open is 1; expected true or false"),
        (dict(is_open="yes"), "is_open is 'yes'; expected true or false"),
        (dict(cook=3), "cook is 3; expected a text"),
        (dict(dish="stwe"), r"dish is 'stwe'; expected one of soup, stew \(did you mean 'stew'\?\)"),
        (dict(dish=3), "dish is 3; expected one of soup, stew"),
        (dict(pan="steal"), r"pan is 'steal'; expected one of iron, steel \(did you mean 'steel'\?\)"),
        (dict(times=3), r"times is 3; expected a list, such as \[3\]$"),
        (dict(times="3,4"), r"times is '3,4'; expected a list, such as \[3,4\]$"),
        (dict(times={}), "times is {}; expected a list$"),
        (dict(times=[1.5]), "times is 1.5; expected a whole number"),
        (dict(heat=10**400), "heat is '10{39}'; expected a finite number"),
        (dict(plates=10**400), "plates is '10{39}'; expected a whole number"),
        (dict(plate=3), r"unknown setting 'plate'; did you mean 'plates'\?$"),
        (dict(kitchen=3), "unknown setting 'kitchen'"),
        (dict(zzz=3), "unknown setting 'zzz'; mwlib train --system house --help lists all$"),
        (dict(warmth=3), "'warmth' is not a setting any more; it is now called 'heat'"),
        (dict(dish="stew"), "minutes is 30.0; expected at least 60 for a stew"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused_in_a_sentence(changes, message):
    with pytest.raises(ValueError, match=f"^{message}"):
        House().override(**changes)


def test_checks_hold_however_a_configuration_is_made():
    with pytest.raises(ValueError, match="plates is 0"):
        House(kitchen=Kitchen(plates=0))
    assert House(kitchen=Kitchen(heat=200)).kitchen.heat == 200.0  # type: ignore[arg-type]
    assert House().override(dish="stew", minutes=90).kitchen.dish == "stew"
    with pytest.raises(ValueError, match="preset is 'large'; expected one of small"):
        House.preset("large")


def test_yaml_goes_there_and_back(tmp_path):
    house = House().override(heat=1e-5, names=["A", "B"], times=[7], lamp=True, cook="1e3")
    assert House.from_yaml(house.to_yaml()) == house
    (tmp_path / "house.yaml").write_text(house.to_yaml())
    assert House.from_yaml(tmp_path / "house.yaml") == house
    assert House.preset(str(tmp_path / "house.yaml"), lamp=False) == house.override(lamp=False), "a file serves as a preset"
    with pytest.raises(FileNotFoundError, match=r"there is no file .*houses.yaml \(did you mean 'house.yaml'\?\)"):
        House.preset(str(tmp_path / "houses.yaml"))
    with pytest.raises(FileNotFoundError, match=r"there is no file smal.yaml \(did you mean 'small'\?\)"):
        House.preset("smal.yaml")


@pytest.mark.parametrize(
    "text, message",
    [
        ("kitchen: {plates: 6}", "does not say which system.*files of mwlib before 0.2.*make the run again"),
        ("system: garden\nkitchen: {plates: 6}", "configures another system; expected system: house"),
        ("system: house\ncellar: {plates: 6}", r"has \['cellar'\]; expected the groups kitchen, table, each a mapping"),
        ("system: house\nkitchen: 6", "expected the groups kitchen, table, each a mapping"),
        ("system: house\nkitchen: {plates: none}", "plates is 'none'; expected a whole number"),
        ("system: house\nkitchen: {warmth: 3}", "it is now called 'heat'"),
        (
            "system: house\nkitchen: {plates: 6}\ntable:\n",
            "lacks the group table, guests, .*; expected every setting, as the run wr",
        ),
        ("- 1", "expected a mapping with system and groups"),
        ("{", "is not YAML"),
        ("system: house\nkitchen: {plates: 6}\nkitchen: {}", "line 3: 'kitchen' is already in line 2; expected each key once"),
        ("system: house\nkitchen:\n  plates: 6\n  plates: 7", "line 4: 'plates' is already in line 3; expected each key once"),
    ],
)
def test_files_that_do_not_fit_are_refused_with_their_place(tmp_path, text, message):
    file = tmp_path / "house.yaml"
    file.write_text(text)
    with pytest.raises(ValueError, match=f"(?s)^{file}.*{message}"):
        House.from_yaml(file)
    with pytest.raises(ValueError, match=f"(?s)^the configuration.*{message}"):
        House.from_yaml(text)


def test_hashes_cover_every_field_and_the_system():
    house = House()
    assert house.hash() == House.from_yaml(house.to_yaml()).hash() == "4ca99aa9", "a change makes every run a stranger"
    assert house.training_hash() == "79bc56de"
    changes = dict(
        plates=5, guests=1, heat=1, salt=0, sugar=0, minutes=1, offset=0, is_open=False, cook="b", pan="steel", times=[1]
    )
    changes |= dict(names=["a"], legs=3, lamp=True)
    assert {*changes, "dish"} == set(House.owners())
    others = {name: house.override(**{name: value}) for name, value in changes.items()}
    assert len({other.hash() for other in others.values()} | {house.hash()}) == len(others) + 1
    free = {name for name, other in others.items() if other.training_hash() == house.training_hash()}
    assert free == {"minutes", "legs", "lamp"}, "a field, and all of a group"

    @dataclass(frozen=True)
    class Hut(House):
        system: ClassVar[str] = "hut"

    assert Hut().hash() != house.hash() and Hut().training_hash() != house.training_hash()

    @dataclass(frozen=True)
    class Older(House):
        newer: ClassVar[dict[str, int]] = {"guests": house.get("guests"), "plates": 99}

    assert (older := Older()).hash() != house.hash() and older.hash() != older.override(guests=1).hash()
    assert older.hash() != older.override(plates=99).hash() and older.training_hash() != older.override(guests=1).training_hash()
    assert Older.from_yaml(older.to_yaml()) == older and "guests" in older.to_yaml()


def test_words_are_read_as_yaml():
    assert parse_changes(["a=1", "b = [x, 2]", "c=1e-3", "d=true", "e=", "f=k=v"]) == {
        "a": 1, "b": ["x", 2], "c": "1e-3", "d": True, "e": None, "f": "k=v",
    }  # fmt: skip
    for words, message in ((["haar"], "expected name=value"), (["level=[1"], "not YAML"), (["a=1", "a =2"], "a is given twice")):
        with pytest.raises(ValueError, match=message):
            parse_changes(words)


@pytest.mark.parametrize("group", Config.groups().values(), ids=lambda group: group.__name__)
def test_every_field_is_explained_on_its_line(group):
    lines = inspect.getsource(group).splitlines()
    (tree,) = ast.parse(inspect.getsource(group)).body
    assert isinstance(tree, ast.ClassDef) and ast.get_docstring(tree)
    places = {node.target.id: node.end_lineno for node in tree.body if isinstance(node, ast.AnnAssign)}  # type: ignore[union-attr]
    assert set(places) == {item.name for item in fields(group)}
    assert [name for name, line in places.items() if len(lines[line - 1].partition("  # ")[2]) < 5] == []


def test_names_are_unique_over_all_groups():
    assert len(Config.owners()) == sum(len(fields(group)) for group in Config.groups().values())


DOUBLED = "a0: &a0 [1, 2]\n" + "".join(f"a{n}: &a{n} [*a{n - 1}, *a{n - 1}]\n" for n in range(1, 18))


@pytest.mark.parametrize(
    "text, message",
    [
        ("a: " + "b" * 250_000, "has 250003 bytes; expected at most 250000"),
        (DOUBLED, "has aliases for more than 250000 entries, or one inside itself; expected fewer"),
        ("a: &a [1, *a]", "has aliases for more than 250000 entries, or one inside itself; expected fewer"),
    ],
)
def test_yaml_that_would_take_all_memory_is_refused(tmp_path, text, message):
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(ValueError, match=f"a.yaml {message}"):
        read_yaml(tmp_path / "a.yaml")
