"""Classes of the user's own take settings with units; a wrong one is told with file and field."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import pytest

from genie_sim.base.errors import UserError
from genie_sim.base.marks import NotEmpty
from genie_sim.base.setting_errors import SettingError
from genie_sim.base.settings import from_plain, plain_data
from genie_sim.scenario.checks import check_own_plugins
from genie_sim.scenario.methods import METHOD
from genie_sim.scenario.reading import load_scenario
from genie_sim.scenario.scenario import Scenario
from genie_sim.sim.link_model import LINK

OWN = """\
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from genie_sim import UserError
from genie_sim.methods.local import Local
from genie_sim.base.marks import Bounds


class Mine(Local):
    def __init__(self, ttl_ns: int, share: Annotated[float, Bounds(above=0, maximum=1)] = 0.5,
                 mode: Literal["fast", "slow"] = "fast", limit_bytes=None):
        self.settings = ttl_ns, share, mode, limit_bytes


class Anything(Local):
    def __init__(self, **settings):
        self.settings = settings


@dataclass(frozen=True)
class Fog:
    target: str
    range_m: float = 10.0

    def strike(self, network): ...


@dataclass(frozen=True)
class Tunnel:
    delay_ns: int
    rate_bps: int = 10**6

    def transmitter(self, network, ends): ...


class Replay(Tunnel):
    needs_sites = True

    def __init__(self, file="rates.txt", digest=None):
        self.file, self.digest = file, digest

    def check(self):
        if not Path(self.file).is_file():
            raise UserError(f"{self.file}: not found")

    def digests(self):
        return self.digest or {"file": Path(self.file).read_text()}


class OfCars(Tunnel):
    needs_cars = True

    def __init__(self): ...


@dataclass(frozen=True)
class Mist(Fog):
    target: str = "edge1"
"""
SCENARIO = """\
edges: [{{name: edge1, device: agx_xavier}}]
cars: [{{name: car1, device: jetson_tx2, edge: edge1, link: {link}}}]
methods: [{method}]
faults: [{fault}]
"""


@pytest.fixture(autouse=True)
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "own_settings_module.py").write_text(OWN)
    (tmp_path / "scenarios/traces").mkdir(parents=True)
    (tmp_path / "scenarios/traces/kitti_0005.parquet").touch()
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)


def scenario(link: str = "wifi", method: str = "local", fault: str = "") -> Scenario:
    def own(text: str) -> str:
        return text.replace("MODULE", "own_settings_module")

    text = SCENARIO.format(link=own(link), method=own(method), fault=own(fault))
    Path("x.yaml").write_text(text)
    return load_scenario("x.yaml")


def test_a_method_takes_quantities_with_units() -> None:
    entry = '{method: "MODULE:Mine", ttl: 300 ms, share: 1, limit: 1.4 MB}'
    setting = scenario(method=entry)
    check_own_plugins(setting)
    method = METHOD.make(setting.methods[0].method)
    assert method.settings == (300_000_000, 1.0, "fast", 1_400_000)
    assert plain_data(setting.methods[0])["ttl"] == "300 ms"


def test_a_link_and_a_fault_take_quantities_with_units() -> None:
    setting = scenario(
        link='{model: "MODULE:Tunnel", delay: 5 ms}',
        fault='{fault: "MODULE:Fog", target: car1, begin: 1 s, range: 50 cm}',
    )
    check_own_plugins(setting)
    assert setting.cars[0].link is not None
    link = LINK.make(setting.cars[0].link)
    assert (link.delay_ns, link.rate_bps) == (5_000_000, 10**6)


def test_a_class_that_takes_any_setting_gets_it_as_it_is_written() -> None:
    setting = scenario(method='{method: "MODULE:Anything", ttl: 300 ms, n: 3}')
    check_own_plugins(setting)
    method = METHOD.make(setting.methods[0].method)
    assert method.settings == {"ttl": "300 ms", "n": 3}


@pytest.mark.parametrize(
    ("field", "settings"),
    [
        ("methods[0].ttl_ms", {"method": '{method: "MODULE:Mine", ttl_ms: 300 ms}'}),
        ("methods[0].ttl", {"method": '{method: "MODULE:Mine", ttl: 300}'}),
        ("methods[0].ttl", {"method": '"MODULE:Mine"'}),
        ("methods[0].share", {"method": '{method: "MODULE:Mine", ttl: 1 s, share: 2}'}),
        ("methods[0].mode", {"method": '{method: "MODULE:Mine", ttl: 1 s, mode: quick}'}),
        ("cars[0].link.rate", {"link": '{model: "MODULE:Tunnel", delay: 5 ms, rate: 1 MB/s}'}),
        ("faults[0].target", {"fault": '{fault: "MODULE:Fog", target: 3, begin: 1 s}'}),
    ],
)
def test_a_wrong_setting_is_told_with_file_and_field(settings: dict[str, str], field: str) -> None:
    setting = scenario(**settings)
    with pytest.raises(UserError) as error:
        check_own_plugins(setting)
    assert str(error.value).startswith(f"x.yaml: {field}: ")
    assert "\n" not in str(error.value)


def test_an_override_is_told_as_it_was_written() -> None:
    scenario(method='"MODULE:Mine"')
    text = 'methods[0]={method: "own_settings_module:Mine", ttl: 3}'
    with pytest.raises(UserError) as error:
        check_own_plugins(load_scenario("x.yaml", [text]))
    assert str(error.value).startswith(f"--set {text}: methods[0].ttl: duration 3 has no unit")


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (["edges[0].at=null"], "x.yaml: cars[0].link: rates.txt: not found"),
        (["cars[0].link.file=x.yaml"], "x.yaml: edges[0].at: missing; link model '"),
        (
            ["cars[0].link=wifi", "edge_network=own_settings_module:OfCars"],
            "edge_network: link model '",
        ),
    ],
)
def test_a_link_model_of_ones_own_says_what_it_needs(settings: list[str], message: str) -> None:
    scenario(link='{model: "MODULE:Replay"}')
    with pytest.raises(UserError) as error:
        check_own_plugins(load_scenario("x.yaml", settings))
    assert message in str(error.value)


def test_the_files_of_ones_own_links_decide_the_outcome() -> None:
    """Each of two that call theirs the same; and only text is a digest."""
    replay = '{model: "own_settings_module:Replay", file: %s}'
    Path("a.txt").write_text("first")
    Path("b.txt").write_text("second")
    setting = scenario(link=replay % "a.txt")
    two = load_scenario("x.yaml", [f"edge_network={replay % 'b.txt'}"])
    before = two.link_digests()
    assert sorted(before.values()) == ["first", "second"]
    Path("a.txt").write_text("third")
    assert sorted(two.link_digests().values()) == ["second", "third"]
    assert [*setting.link_digests().values()] == ["third"]
    with pytest.raises(UserError, match=r"own_settings_module:Replay.*digests\(\) is .3"):
        load_scenario("x.yaml", ["cars[0].link.digest=[3]"]).link_digests()


def test_a_fault_of_ones_own_may_be_all_defaults() -> None:
    setting = scenario(fault='{fault: "MODULE:Mist", begin: 3 s}')
    again = from_plain(Scenario, plain_data(setting))
    assert again.faults == setting.faults and again.faults[0].fault.name.endswith(":Mist")


@dataclass(frozen=True, kw_only=True)
class Labels:
    names: Annotated[tuple[str, ...], NotEmpty()]


def test_a_list_that_must_not_be_empty_may_hold_what_is():
    assert from_plain(Labels, {"names": [""]}).names == ("",)
    with pytest.raises(SettingError, match="must not be empty"):
        from_plain(Labels, {"names": []})
