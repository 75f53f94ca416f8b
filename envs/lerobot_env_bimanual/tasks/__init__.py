"""One module per task; importing this package fills the registry."""

from lerobot_env_bimanual.tasks import (
    dual_push_buttons,
    handover_item,
    handover_item_easy,
    lift_ball,
    lift_tray,
    pick_laptop,
    pick_plate,
    push_box,
    put_bottle_in_fridge,
    put_item_in_drawer,
    straighten_rope,
    sweep_to_dustpan,
    take_tray_out_of_oven,
)

__all__ = [
    "dual_push_buttons",
    "handover_item",
    "handover_item_easy",
    "lift_ball",
    "lift_tray",
    "pick_laptop",
    "pick_plate",
    "push_box",
    "put_bottle_in_fridge",
    "put_item_in_drawer",
    "straighten_rope",
    "sweep_to_dustpan",
    "take_tray_out_of_oven",
]
