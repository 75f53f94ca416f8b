"""One module per task; importing this package fills the registry."""

from lerobot_env_bimanual.tasks import handover_item_easy, lift_ball, lift_tray, pick_plate, push_box

__all__ = ["handover_item_easy", "lift_ball", "lift_tray", "pick_plate", "push_box"]
