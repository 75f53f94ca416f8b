"""What the PerAct2 paper says about its tasks, to stand beside what is measured here."""

from dataclasses import dataclass


@dataclass(frozen=True)
class PaperFigures:
    """A task's row of the paper's table of tasks.

    Attributes:
        duration_s: mean duration of a demonstration. (Each is a whole number of frames at 30 Hz, while frames are
            simulated at 20 Hz, so the simulated time was probably 1.5 times as long.)
        keyframes: per demonstration, on average.
        items: objects that are handled.
    """

    duration_s: float
    keyframes: float
    items: int


PAPER: dict[str, PaperFigures] = {
    "push_box": PaperFigures(4.33, 2.1, 1),
    "lift_ball": PaperFigures(4.40, 4.0, 1),
    "dual_push_buttons": PaperFigures(3.47, 4.0, 3),
    "pick_plate": PaperFigures(6.47, 6.6, 1),
    "put_item_in_drawer": PaperFigures(5.57, 8.4, 5),
    "put_bottle_in_fridge": PaperFigures(9.70, 7.8, 2),
    "handover_item": PaperFigures(7.63, 7.6, 5),
    "pick_laptop": PaperFigures(3.97, 7.2, 1),
    "straighten_rope": PaperFigures(3.83, 5.9, 1),
    "sweep_to_dustpan": PaperFigures(4.93, 7.3, 1),
    "lift_tray": PaperFigures(3.77, 5.1, 1),
    "handover_item_easy": PaperFigures(7.17, 7.5, 1),
    "take_tray_out_of_oven": PaperFigures(10.13, 8.7, 2),
}

ORIGINAL_ORACLE = {"pick_plate": 0.59, "straighten_rope": 0.39}
"""Success of ground-truth keyposes replayed in the original simulator, where it has been published."""
ORIGINAL_ORACLE_MEAN = 0.858
"""The same over all thirteen tasks (appendix C.10 of 3D FlowMatch Actor, arXiv 2508.11002)."""
