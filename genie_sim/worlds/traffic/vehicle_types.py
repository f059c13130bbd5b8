"""What vehicles of a type are, by what the type is called in a file."""

import re
from dataclasses import dataclass
from typing import Annotated, Literal

from genie_sim.base.marks import Bounds
from genie_sim.worlds.scene.objects import LONGEST_M


@dataclass(frozen=True)
class VehicleType:
    """What vehicles of one type are."""

    label: Literal["car", "truck", "bus", "train", "motorcycle", "bicycle"]
    """Their class, as a detector calls it."""

    length_m: Annotated[float, Bounds(above=0, maximum=LONGEST_M)] = 5.0
    """Their length: SUMO tells where the front bumper is."""

    width_m: Annotated[float, Bounds(above=0, maximum=LONGEST_M)] = 1.8
    """Their width."""


# Words in the names of types, as SUMO's own tools write them, and the sizes that SUMO gives to
# vehicles of that class by default [S: sumo.dlr.de/docs/Vehicle_Type_Parameter_Defaults.html].
USUAL = VehicleType("car", 5.0, 1.8)
TYPES = {
    **dict.fromkeys(("bus", "minibus", "citybus", "trolleybus"), VehicleType("bus", 12.0, 2.5)),
    "coach": VehicleType("bus", 14.0, 2.6),
    **dict.fromkeys(("truck", "lorry"), VehicleType("truck", 7.1, 2.4)),
    **dict.fromkeys(("trailer", "semitrailer"), VehicleType("truck", 16.5, 2.55)),
    "tram": VehicleType("train", 22.0, 2.4),
    **dict.fromkeys(("rail", "train"), VehicleType("train", 67.5, 2.84)),
    **dict.fromkeys(("motorcycle", "motorbike"), VehicleType("motorcycle", 2.2, 0.9)),
    "moped": VehicleType("motorcycle", 2.1, 0.8),
    **dict.fromkeys(("bicycle", "bike"), VehicleType("bicycle", 1.6, 0.65)),
}
# words in the names of types that are known to be cars, unless there is a word of something else
CARS = {"car", "passenger", "taxi", "default", "veh", "vehicle", "private", "evehicle", "hov"}
OTHERS = {"aircraft", "cable", "container", "drone", "scooter", "ship", "subway", "wheelchair"}


def words_of(name: str) -> list[str]:
    """The words in the name of a type, such as bike and default for ``DEFAULT_BIKETYPE``."""
    split = re.sub("([a-z])([A-Z])", r"\1 \2", name).lower()
    words = re.findall("[a-z]+", split)
    return [word.removesuffix("type").removesuffix("veh") or word for word in words]


def _singulars(word: str) -> tuple[str, ...]:
    """A word, and what it is the plural of if it is one: trucks, buses, lorries."""
    return word, word.removesuffix("s"), word.removesuffix("es"), re.sub("ies$", "y", word)


def type_named(name: str) -> VehicleType | None:
    """What a type is by the words in its name; ``None`` where none says so."""
    forms = [form for word in words_of(name) for form in _singulars(word)]
    car = USUAL if CARS.intersection(forms) and not OTHERS.intersection(forms) else None
    return next((TYPES[form] for form in forms if form in TYPES), car)
