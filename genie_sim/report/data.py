"""What the report's page shows, as plain JSON values: what was run, metrics, curves, use of
resources.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from genie_sim.analysis.frame_metrics import response_ms
from genie_sim.analysis.genie_metrics import images, objects, running_boost, running_reuse
from genie_sim.analysis.metric import DEADLINE_MS, MAIN, ZERO_DELAY
from genie_sim.analysis.registry import METRICS, component_title, definition, words
from genie_sim.analysis.resource_metrics import running_use
from genie_sim.analysis.screen import simulated_s
from genie_sim.analysis.statistics import thinned
from genie_sim.analysis.style import PARTS, PLACEMENTS, method_styles
from genie_sim.analysis.summary import about_boxes, about_laws, energy_note, no_repeats, overload
from genie_sim.base import units
from genie_sim.base.text import finite, natural_key
from genie_sim.base.units import NS_PER_S
from genie_sim.report.replay import replay_data
from genie_sim.report.replay_pictures import Pictures

if TYPE_CHECKING:
    from genie_sim.record.columns import Columns
    from genie_sim.record.results import MetricValue, Run

    Floats = np.ndarray[Any, np.dtype[np.float64]]

POINTS_PER_CURVE = 500
BINS = 240
MIN_BIN_NS, SAMPLE_NS = 500_000_000, 100_000_000
MIN_USE = 0.01
GENIES_PER_PLACEMENT = 8
RESOURCES_PER_KIND = 8
RESOURCES_ON_PAGE = 300


def page_data(run: "Run", start_ns: int = 0, pictures: Pictures | None = None) -> dict[str, Any]:
    """Everything on the page. ``start_ns`` is where the replay begins, if the run is too long to be
    shown whole; ``pictures`` are those of its cameras.
    """
    notes: list[str] = []
    lookups = run.tables["lookups"]
    return {
        "about": _about(run),
        "methods": list(_methods(run)),
        "metrics": [
            [finite(value) if isinstance(value, float) else value for value in metric.row]
            for metric in _shown(run.measured, notes)
        ],
        "parts": [{"name": name, "title": title} for name, (title, _) in PARTS.items()],
        "metric_info": metric_info(metric.metric for metric in run.measured),
        "main_tier": MAIN,
        "zero_delay": zero_delay(),
        "deadline_ms": DEADLINE_MS,
        "cdf": list(_cdfs(run)),
        "over_time": {
            "image_reuse": list(_reuse(run, images(lookups), notes)),
            "object_reuse": list(_reuse(run, objects(lookups), notes)),
            "confidence_boost": list(_boost(run)),
        },
        "use": list(_use(run, notes)),
        "faults": list(_faults(run, notes)),
        "replay": replay_data(run, start_ns, notes, pictures),
        "fleet": _fleet(run, notes),
        "energy_note": energy_note(
            [run.tables], {method.name: method.title for method in run.methods}
        ),
        "notes": [
            *filter(
                None,
                dict.fromkeys(
                    [overload(run), no_repeats(run), *notes, about_boxes(run), about_laws(run)]
                ),
            )
        ],
    }


def _fleet(run: "Run", notes: list[str]) -> dict[str, Any] | None:
    """What the page draws of a fleet's map; ``None`` for cars and edges given one by one."""
    if run.facts["scenario"].get("fleet") is None:
        return None
    from genie_sim.report.fleet_map import fleet_data

    return fleet_data(run, notes)


SHADED = (
    "Shaded spans in the charts over time are faults; the table of all metrics has values before, "
    "during and after the first one."
)


def _faults(run: "Run", notes: list[str]) -> Iterator[dict[str, Any]]:
    """When faults that are no hand-overs lasted [s]; ``None`` for what had not ended."""
    faults = run.tables["faults"]
    ends_s = faults.floats("end_ns") / NS_PER_S
    rows = zip(
        faults["method"].tolist(), faults["fault"].tolist(), faults["target"].tolist(), strict=True
    )
    for number, (method, fault, target) in enumerate(rows):
        if fault != "hand_over":
            notes.append(SHADED)
            begin_s = float(faults["begin_ns"][number]) / NS_PER_S
            end_s = None if np.isnan(ends_s[number]) else float(ends_s[number])
            yield {"method": method, "fault": fault, "target": target, "from": begin_s, "to": end_s}


def zero_delay() -> dict[str, str]:
    """The name and the title of the detector without any delay, beside the methods."""
    return {"component": ZERO_DELAY, "title": component_title(ZERO_DELAY)}


def metric_info(metrics: Iterable[str]) -> dict[str, dict[str, Any]]:
    """What pages say of these metrics, in the order in which they are shown."""
    names = set(metrics)
    return words([*(name for name in METRICS if name in names), *sorted(names - METRICS.keys())])


def _methods(run: "Run") -> Iterator[dict[str, Any]]:
    """The methods in their order, with their frames, and of their first answers the share from the
    object map.
    """
    styles = method_styles([method.name for method in run.methods])
    for style, method in zip(styles, run.methods, strict=True):
        frames = run.tables["frames"].where(method=method.name)
        answered = frames.rows(~np.isnan(frames.floats("first_answer_ns")))
        from_map = finite(float((answered["source"] == "map").mean())) if len(answered) else None
        yield {**asdict(method), "look": style, "frames": len(frames), "from_map": from_map}


def _about(run: "Run") -> dict[str, Any]:
    """What was run, in words and in the words of the scenario file."""
    scenario = run.facts["scenario"]
    devices = {name: device["title"] for name, device in run.facts["devices"].items()}
    genie = scenario["genie"]
    similarity = genie["similarity"]
    cars, edges = _who(scenario, devices, _how_many(run)["cars"])
    return {
        "name": run.title,
        "description": scenario["description"],
        "warning": run.warning,
        "run_id": run.run_id,
        "genie_sim": run.facts["genie_sim"],
        "seed": scenario["seed"],
        "model": scenario["model"],
        "seconds": round(simulated_s(run.tables["frames"]), 3),
        "warm_up": run.warm_up,
        "cars": cars,
        "edges": edges,
        "how_many": _how_many(run),
        "cameras": [camera["name"] for camera in scenario["cameras"]],
        "similarity": similarity if isinstance(similarity, str) else similarity["name"],
        **{name: genie[name] for name in ("eviction", "miss_policy")},
        **{name: genie["object_map"][name] for name in ("rule", "threshold")},
        "yaml": run.yaml,
    }


def _who(
    scenario: Mapping[str, Any], devices: Mapping[str, str], count: int | None
) -> tuple[list[Any], list[Any]]:
    """Cars and edges, one by one; of a fleet of ``count`` cars those of each device, and all edges
    together.
    """
    fleet = scenario.get("fleet")
    if fleet is None:
        cars = [
            {"name": car["name"], **_car(car, devices[car["device"]])} for car in scenario["cars"]
        ]
        return cars, [
            {"name": edge["name"], "device": devices[edge["device"]]} for edge in scenario["edges"]
        ]
    way = "a way of its own on the map"
    if "town" in scenario["perception"]:
        way = f"{scenario['perception']['duration']} of commuting through the town"
    of_all = {
        "edge": "the nearest",
        "link": _link(fleet["link"]),
        "route": way,
        "cameras": True,
        "genie": True,
    }
    cars = [
        {"name": f"{100 * share:.4g} % of {count:,} cars", "device": devices[name], **of_all}
        for name, share in fleet["devices"].items()
        if name in devices  # of a small fleet, a small share may be no car at all
    ]
    return cars, [
        {"name": f"an edge about every {fleet['cell']}", "device": devices[fleet["edge_device"]]}
    ]


def _how_many(run: "Run") -> dict[str, int | None]:
    """Cars and edges. A fleet's resources are those of its edges; without them nobody counted the
    edges.
    """
    scenario = run.facts["scenario"]
    fleet = scenario.get("fleet")
    if fleet is None:
        return {"cars": len(scenario["cars"]), "edges": len(scenario["edges"])}
    accelerators = run.tables["resources"].where(kind="accelerator")["resource"].unique()
    # Traffic brings its own cars.
    cars = fleet["cars"] or len(run.tables["frames"]["car"].unique())
    return {"cars": cars, "edges": len(accelerators) or None}


def _car(car: Mapping[str, Any], device: str) -> dict[str, Any]:
    same = {name: car[name] for name in ("edge", "cameras", "genie")}
    return {"device": device, "link": _link(car["link"]), "route": _route(car["route"]), **same}


def _link(link: object) -> str | None:
    return link if isinstance(link, str | None) else "a link of its own"


def _shown(measured: "Sequence[MetricValue]", notes: list[str]) -> "list[MetricValue]":
    """All metrics but those of the less busy of very many resources."""
    use: dict[tuple[str, str], float] = {}
    for metric in measured:
        if definition(metric.metric).rows == "resources":
            resource = metric.method, metric.component
            value = metric.value if metric.metric == "utilization" else None
            use[resource] = max(use.get(resource, 0.0), value or 0.0)
    if len(use) <= RESOURCES_ON_PAGE:
        return list(measured)
    notes.append(
        f"The table of metrics shows the {RESOURCES_ON_PAGE} busiest of {len(use):,} devices, "
        "links and queues; all are in metrics.json."
    )
    left_out = set(sorted(use, key=lambda resource: (-use[resource], resource))[RESOURCES_ON_PAGE:])
    return [metric for metric in measured if (metric.method, metric.component) not in left_out]


def _route(route: Mapping[str, Any]) -> str:
    """``0 s to 9.2 s of the drive, 2 laps``."""
    window = route["window"]
    parts = [f"{window[0]} to {window[1]} of the drive" if window else "the whole drive"]
    if route["trace"]:
        parts.append(f"of {route['trace']}")
    if route["laps"] > 1:
        parts.append(f"{route['laps']} laps")
    if units.duration_ns(route["start"]):
        parts.append(f"from {route['start']} on")
    return ", ".join(parts)


def _cdfs(run: "Run") -> Iterator[dict[str, Any]]:
    """Response times of each method. ``rank[i]`` of ``published`` frames were answered within
    ``ms[i]``.
    """
    for method in run.methods:
        frames = run.tables["frames"].where(method=method.name)
        for answer in ("first", "fresh"):
            times = response_ms(frames, answer)
            in_order = np.sort(times[~np.isnan(times)])
            places = thinned(len(in_order), POINTS_PER_CURVE)
            if len(frames):
                yield {
                    "method": method.name,
                    "answer": answer,
                    "published": len(frames),
                    "answered": len(in_order),
                    "ms": _list(in_order[places], 3),
                    "rank": (places + 1).tolist(),
                }


def _placed(run: "Run", lookups: "Columns") -> "Iterator[tuple[dict[str, str], Columns]]":
    """The look-ups of each method's Genies on cars, and on edges."""
    for method in run.methods:
        for placement in PLACEMENTS:
            where = {"method": method.name, "placement": placement}
            yield where, lookups.where(**where)


def _reuse(run: "Run", lookups: "Columns", notes: list[str]) -> Iterator[dict[str, Any]]:
    """hits / requests of each Genie so far."""
    for where, placed in _placed(run, lookups):
        running = running_reuse(placed)
        genies = sorted(running["genie"].unique(), key=natural_key)
        if len(genies) > GENIES_PER_PLACEMENT:
            shown = (
                f"{GENIES_PER_PLACEMENT} of {len(genies)} Genies {PLACEMENTS[where['placement']]}"
            )
            notes.append(f"Reuse over time shows {shown}; the metrics count all.")
        for genie in genies[:GENIES_PER_PLACEMENT]:
            of_genie = running.where(genie=genie)
            yield {**where, "name": genie, **_curve(of_genie["t_ns"], of_genie["ratio"], 3)}


def _boost(run: "Run") -> Iterator[dict[str, Any]]:
    """Confidence that the maps on cars, and on edges, added so far over the objects they store."""
    for where, placed in _placed(run, objects(run.tables["lookups"])):
        running = running_boost(placed)
        if len(running):
            yield {**where, "name": "", **_curve(running["t_ns"], running["boost"], 5)}


def _curve(t_ns: "Floats", values: "Floats", digits: int) -> dict[str, list[float]]:
    places = thinned(len(values), POINTS_PER_CURVE)
    return {"x": _list(t_ns[places] / NS_PER_S, 2), "y": _list(values[places], digits)}


def _use(run: "Run", notes: list[str]) -> Iterator[dict[str, Any]]:
    """Share of time spent serving, or mean length of a queue, in equal parts of the time while
    frames were taken.
    """
    resources, stamps_ns = run.tables["resources"], run.tables["frames"]["stamp_ns"]
    end_ns = int(stamps_ns.max()) if len(stamps_ns) else 0
    if not len(resources) or not end_ns:
        return
    if run.facts["scenario"].get("fleet"):
        notes.append("Of a fleet, devices, links and queues of the edges alone are recorded.")
    width_ns = max(MIN_BIN_NS, -(-end_ns // (BINS * SAMPLE_NS)) * SAMPLE_NS)
    edges_ns = np.arange(run.warm_up_ns, end_ns + width_ns, width_ns, dtype=np.float64)
    middles = _list((edges_ns[1:] + edges_ns[:-1]) / 2 / NS_PER_S, 2)
    groups = (
        (method, kind, samples)
        for method, of_method in resources.groups("method")
        for kind, samples in of_method.groups("kind")
    )
    for method, kind, group in groups:
        curves = {name: _mean_use(samples, edges_ns) for name, samples in group.groups("resource")}
        busiest = sorted(curves, key=lambda name: (-float(curves[name].sum()), name))
        used = [name for name in busiest if curves[name].max() >= MIN_USE]
        if len(used[:RESOURCES_PER_KIND]) < len(curves):
            notes.append(
                f"Use over time shows at most the {RESOURCES_PER_KIND} busiest of each kind, and "
                f"none that never reached {MIN_USE:.0%}; all are in the table of metrics."
            )
        for name in sorted(used[:RESOURCES_PER_KIND]):
            yield {
                "method": method,
                "kind": kind,
                "name": name,
                "x": middles,
                "y": _list(curves[name], 4),
            }


def _mean_use(samples: "Columns", edges_ns: "Floats") -> "Floats":
    mean: Floats = np.diff(np.interp(edges_ns, *running_use(samples))) / np.maximum(
        np.diff(edges_ns), 1.0
    )
    return mean


def _list(values: "Floats", digits: int) -> list[float]:
    numbers: list[float] = np.round(values, digits).tolist()
    return numbers
