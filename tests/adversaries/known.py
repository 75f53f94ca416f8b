"""The adversaries that act by joint actions: task, module of this folder, and the arm that gets furthest."""

KNOWN = (
    ("put_bottle_in_fridge", "put_bottle_in_fridge", "left"),
    ("pick_plate", "pick_plate", "right"),
    ("sweep_to_dustpan", "sweep_to_dustpan", "left"),
    ("sweep_to_dustpan", "sweep_to_dustpan", "right"),
    ("push_box", "push_box", "right"),
    ("handover_item_easy", "handover", "left"),
    ("handover_item", "handover", "left"),
    ("dual_push_buttons", "dual_push_buttons", "right"),
    ("lift_ball", "lift_ball", "left"),
    ("straighten_rope", "straighten_rope", "left"),
)
