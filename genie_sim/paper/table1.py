"""Table I of the paper, as printed, and our device profiles beside it."""

from dataclasses import dataclass

from genie_sim.analysis import renderers
from genie_sim.analysis.result_table import ResultTable
from genie_sim.scenario.profiles import load_profile

DEVICES = {"Nano": "orin_nano", "AGX": "agx_xavier", "Orin": "agx_orin", "A4500": "rtx_a4500"}
MODELS = {
    "YOLOv8s": "yolov8s",
    "YOLOv8m": "yolov8m",
    "YOLOv8l": "yolov8l",
    "DETR-ResNet-50": "detr_resnet_50",
    "DETR-ResNet-101": "detr_resnet_101",
    "DETR-ResNet-101-DC5": "detr_resnet_101_dc5",
}
# Milliseconds and speed-up as printed; None: OOM / N/A.
PRINTED: dict[str, tuple[tuple[float, float] | None, ...]] = {
    "YOLOv8s": ((27.60, 1.00), (21.20, 1.30), (13.73, 2.01), (5.50, 5.02)),
    "YOLOv8m": ((60.90, 1.00), (48.45, 1.26), (17.50, 3.48), (7.10, 2.46)),
    "YOLOv8l": ((92.00, 1.00), (85.50, 1.08), (26.20, 3.51), (9.70, 2.70)),
    "DETR-ResNet-50": ((307.28, 1.00), (230.39, 1.33), (112.26, 2.74), (30.91, 9.94)),
    "DETR-ResNet-101": ((422.51, 1.00), (336.96, 1.25), (145.92, 2.90), (40.73, 10.37)),
    "DETR-ResNet-101-DC5": (None, (747.30, 1.00), (316.52, 2.36), (86.13, 8.68)),
}
ROUNDING = 0.0051  # two decimals


@dataclass(frozen=True, slots=True)
class TableCell:
    """One model on one device: printed and our milliseconds (``None``: out of memory), printed and
    right speed-up.
    """

    model: str
    device: str
    printed_ms: float | None
    ours_ms: float | None
    printed_speedup: float | None
    speedup: float | None

    @property
    def misprinted(self) -> bool:
        if self.printed_speedup is None or self.speedup is None:
            return self.printed_speedup is not self.speedup
        return abs(self.printed_speedup - self.speedup) > ROUNDING

    def __str__(self) -> str:
        """As printed; a misprinted speed-up is followed by the right one in bold."""
        if self.printed_ms is None:
            return "out of memory"
        right = f" **{self.speedup:.2f}x**" if self.misprinted else ""
        return f"{self.printed_ms:.2f} / {self.printed_speedup:.2f}x{right}"


def cells() -> list[TableCell]:
    """All 24 cells; the speed-up is over the slowest device that can run the model, as the caption
    says.
    """
    table = []
    profiles = {column: load_profile(name) for column, name in DEVICES.items()}
    for model, printed in PRINTED.items():
        slowest = max(cell[0] for cell in printed if cell is not None)
        for (column, profile), cell in zip(profiles.items(), printed, strict=True):
            median_ns = profile.models[MODELS[model]].median_ns
            ms, speedup = cell or (None, None)
            right = None if ms is None else slowest / ms
            table.append(
                TableCell(
                    model,
                    column,
                    ms,
                    None if median_ns is None else median_ns / 1e6,
                    speedup,
                    right,
                )
            )
    return table


def markdown() -> str:
    """The table with its printed speed-ups."""
    table_cells = cells()
    table = ResultTable.of_texts(
        ["model", *DEVICES],
        ([model, *(str(cell) for cell in table_cells if cell.model == model)] for model in MODELS),
    )
    legend = (
        "Milliseconds / speed-up over the slowest device. Bold: what the printed one should be."
    )
    return f"{renderers.markdown(table)}\n{legend}"
