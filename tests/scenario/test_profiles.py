"""Device profiles: the paper's Table I and the figures behind the evaluation, each with tag and
source.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from genie_sim.base import files
from genie_sim.base.errors import UserError
from genie_sim.base.seeds import stream
from genie_sim.base.setting_errors import SettingError
from genie_sim.runs import build
from genie_sim.scenario.power import Watts
from genie_sim.scenario.profiles import DeviceProfile, load_profile
from genie_sim.sim.device import ServiceTime
from tests.make import scenario

SHIPPED = [
    "jetson_tx2",
    "agx_xavier",
    "quadro_rtx_4000",
    "quadro_rtx_4000_q31",
    "orin_nano",
    "agx_orin",
    "rtx_a4500",
]
TABLE_I = {  # milliseconds: Nano, AGX, Orin, A4500
    "yolov8s": (27.60, 21.20, 13.73, 5.50),
    "yolov8m": (60.90, 48.45, 17.50, 7.10),
    "yolov8l": (92.00, 85.50, 26.20, 9.70),
    "detr_resnet_50": (307.28, 230.39, 112.26, 30.91),
    "detr_resnet_101": (422.51, 336.96, 145.92, 40.73),
    "detr_resnet_101_dc5": (None, 747.30, 316.52, 86.13),
}


def median_ms(device: str, model: str) -> float:
    return load_profile(device).median_ns(model) / 1e6


def profile_data(**changes: Any) -> dict[str, Any]:
    data = yaml.safe_load(Path("device_profiles/jetson_tx2.yaml").read_text())
    return {**data, **changes}


def refusal(data: dict[str, Any], tmp_path: Path) -> str:
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(UserError) as error:
        load_profile(path)
    return str(error.value).replace(f"{tmp_path}/", "")


@pytest.fixture(autouse=True)
def in_the_checkout(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(Path(__file__).parents[2])


def test_all_shipped_profiles_load_and_bear_their_file_name() -> None:
    assert sorted(files.available(files.DEVICE)) == sorted(SHIPPED)
    for name in SHIPPED:
        assert load_profile(name).name == name


@pytest.mark.parametrize(
    ("column", "device"), list(enumerate(["orin_nano", "agx_xavier", "agx_orin", "rtx_a4500"]))
)
def test_table_i(column: int, device: str) -> None:
    profile = load_profile(device)
    for model, row in TABLE_I.items():
        if row[column] is None:
            assert profile.models[model].oom
        else:
            assert median_ms(device, model) == row[column]
        assert profile.models[model].tag == "P"


def test_derived_columns_follow_their_formulas() -> None:
    for model, (_, agx, _, a4500) in TABLE_I.items():
        assert agx is not None and a4500 is not None
        assert median_ms("jetson_tx2", model) == pytest.approx(agx * 3.34, rel=1e-3)
        floor = a4500 * 1.54 if model == "yolov8s" else 0.0
        assert median_ms("quadro_rtx_4000", model) == pytest.approx(max(agx / 4, floor), rel=1e-3)
        assert median_ms("quadro_rtx_4000_q31", model) == pytest.approx(
            max(agx / 3.1, floor), rel=1e-3
        )
    avd = "autoware_vision_detector"
    for device, column in (("orin_nano", 0), ("agx_orin", 2), ("rtx_a4500", 3)):
        ratio = TABLE_I["yolov8m"][column] / TABLE_I["yolov8m"][1]  # type: ignore[operator]
        assert median_ms(device, avd) == pytest.approx(65 * ratio, rel=1e-3)
        assert load_profile(device).models[avd].tag == "D"
    for device in SHIPPED:
        assert median_ms(device, f"{avd}_608") == pytest.approx(
            median_ms(device, avd) * (608 / 416) ** 2, rel=1e-3
        )


def test_the_evaluation_devices() -> None:
    avd = "autoware_vision_detector"
    assert [median_ms(name, avd) for name in SHIPPED[:3]] == [310, 65, 16.25]
    assert median_ms("agx_xavier", avd) / median_ms("quadro_rtx_4000", avd) == 4.0
    assert median_ms("agx_xavier", avd) / median_ms("quadro_rtx_4000_q31", avd) == pytest.approx(
        3.1, rel=1e-3
    )


def test_genie_takes_8_8_ms_on_average_on_every_host() -> None:
    for name in SHIPPED:
        device = build.device(load_profile(name), "autoware_vision_detector")
        assert device.message_time.mean_ns == pytest.approx(8.8e6, rel=1e-3)


def test_an_image_s_ipc_takes_3_ms_on_a_jetson_and_half_on_a_server() -> None:
    hops = {
        name: build.device(load_profile(name), "autoware_vision_detector").hop.of(1_397_297)
        for name in ("jetson_tx2", "quadro_rtx_4000")
    }
    assert 3.0e6 <= hops["jetson_tx2"] <= 3.5e6
    assert hops["quadro_rtx_4000"] == pytest.approx(3.5e6 / 2, rel=0.01)


def test_a_power_lies_within_its_range() -> None:
    def watts(value: float, low: float, high: float) -> Watts:
        return Watts(value_w=value, low_w=low, high_w=high, tag="A", source="test")

    assert watts(5, 5, 5).value_w == 5
    for wrong in ((4, 5, 6), (7, 5, 6), (5, 6, 4)):
        with pytest.raises(SettingError, match="'low' to 'high'"):
            watts(*wrong)


def test_every_number_says_where_it_comes_from() -> None:
    """A mapping with a number in it has a tag and a source, but for the laws, whose two numbers
    share one.
    """

    def check(value: object, path: str) -> None:
        if isinstance(value, dict):
            if any(isinstance(item, int | float) for item in value.values()):
                assert value["tag"] in {"P", "S", "D", "A"} and value["source"], path
            for key, item in value.items():
                check(item, f"{path}.{key}")

    for name, path in files.available(files.DEVICE).items():
        check(yaml.safe_load(path.read_text()), name)


@pytest.mark.parametrize(
    ("device", "spread", "p95_ms", "p99_ms"),
    [
        ("jetson_tx2", "default", 388, 451),
        ("agx_xavier", "default", 82, 95),
        ("quadro_rtx_4000", "default", 18.3, 19.8),
        ("agx_xavier", "loaded", None, 65 * 2.24),
    ],
)
def test_the_law_has_the_published_tail(
    device: str, spread: str, p95_ms: float | None, p99_ms: float
) -> None:
    """Quantiles of 200,000 samples, seed 1; margin 3 %."""
    law = build.detector_time(load_profile(device), "autoware_vision_detector", spread)
    rng = stream(1, device, spread)
    samples_ms = np.array([law.at(z) for z in rng.standard_normal(200_000)]) / 1e6
    assert np.median(samples_ms) == pytest.approx(law.median_ns / 1e6, rel=0.01)
    assert np.mean(samples_ms) == pytest.approx(law.mean_ns / 1e6, rel=0.01)
    assert np.quantile(samples_ms, 0.99) == pytest.approx(p99_ms, rel=0.03)
    if p95_ms is not None:
        assert np.quantile(samples_ms, 0.95) == pytest.approx(p95_ms, rel=0.03)


def test_a_time_is_a_positive_integer() -> None:
    law = ServiceTime(median_ns=1, loc=0.0, sigma=5.0)
    for z in stream(1, "x").standard_normal(100):
        assert isinstance(law.at(z), int)
        assert law.at(z) == max(1, round(math.exp(5.0 * z)))


def test_a_users_own_profile(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(profile_data(name="mine")))
    profile = load_profile(str(path))
    assert isinstance(profile, DeviceProfile) and profile.name == "mine"


def test_asking_for_what_a_device_cannot_do() -> None:
    nano = load_profile("orin_nano")
    with pytest.raises(
        UserError, match=r"^orin_nano: model 'detr_resnet_101_dc5' runs out of memory$"
    ):
        nano.median_ns("detr_resnet_101_dc5")
    with pytest.raises(
        UserError,
        match=r"^orin_nano: unknown model 'yolov9s' \(did you mean 'yolov8s'\?\)",
    ):
        nano.median_ns("yolov9s")
    with pytest.raises(UserError, match=r"^unknown device 'tx2'"):
        load_profile("tx2")


TIME = {"median": "1 ms", "tag": "A", "source": "a guess"}


@pytest.mark.parametrize(
    ("field", "changes"),
    [
        ("coers", {"coers": 4}),
        ("cores", {"cores": 4}),
        ("cores.value", {"cores": {"value": 0, "tag": "S", "source": "x"}}),
        ("cores.source", {"cores": {"value": 4, "tag": "S"}}),
        ("cores.source", {"cores": {"value": 4, "tag": "S", "source": ""}}),
        ("cores.tag", {"cores": {"value": 4, "tag": "X", "source": "x"}}),
        ("models.net.median", {"models": {"net": {**TIME, "median": 310}}}),
        ("models.net.median", {"models": {"net": {**TIME, "median": "-1 ms"}}}),
        ("models.net.median", {"models": {"net": {**TIME, "oom": True}}}),
        ("models", {"models": None}),
    ],
)
def test_mistakes_in_a_profile(changes: dict[str, Any], field: str, tmp_path: Path) -> None:
    assert refusal(profile_data(**changes), tmp_path).startswith(f"mine.yaml: {field}: ")


def test_two_profiles_that_differ_have_two_names(tmp_path: Path) -> None:
    """Energy is counted by name: the last of them would count for both."""
    same, other = tmp_path / "same.yaml", tmp_path / "other.yaml"
    same.write_text(yaml.safe_dump(profile_data()))
    other.write_text(yaml.safe_dump(profile_data(power=None)))
    assert set(scenario([car("car1"), car("car2", str(same))]).profiles) >= {str(same)}
    with pytest.raises(UserError, match=r"^scenario: cars\[1\]\.device: .* 'jetson_tx2'"):
        scenario([car("car1"), car("car2", str(other))])
    with pytest.raises(UserError, match=r"^scenario: edges\[0\]\.device: .* 'jetson_tx2'"):
        scenario([car("car1")], edges=[{"name": "edge1", "device": str(other)}])


def car(name: str, device: str = "jetson_tx2") -> dict[str, Any]:
    return {"name": name, "device": device, "edge": None}
