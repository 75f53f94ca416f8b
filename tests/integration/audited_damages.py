"""The damages that the audit of November 2026 planted, and what finds them."""

import damages as d

FLAG = 7
"""Place of the left gripper's flag in a keypose, and of the gripper in a joint action."""

AUDITED = (
    d.Damage(
        "gripper actions 1.0 -> 1e6",
        "actions",
        d.column("action", d.each(d.element(FLAG, lambda v: v * 1e6))),
    ),
    d.Damage(
        "labels' flags 0/1 -> 0.4/0.6",
        "forms",
        d.column("observation.next_keypose", d.each(d.element(FLAG, lambda v: 0.4 + 0.2 * v))),
    ),
    d.Damage("labels' quaternions negated", "forms", d.column("observation.next_keypose", d.each(d.negated))),
    d.Damage("seed column -> -5", "episode key", d.column("seed", d.each(lambda _: -5))),
    d.Damage("variation column -> 99", "episode key", d.column("variation", d.each(lambda _: 99))),
    d.Damage("timestamp + 1 frame", "bookkeeping", d.column("timestamp", d.each(lambda v: v + 0.05))),
    d.Damage("task_index -> 1", "bookkeeping", d.column("task_index", d.each(lambda _: 1))),
    d.Damage("frame_index + 5", "bookkeeping", d.column("frame_index", d.each(lambda v: v + 5))),
    d.Damage("index + 5", "order of rows", d.column("index", d.each(lambda v: v + 5))),
    d.Damage(
        "tasks.parquet says drop the ball",
        "sentences",
        lambda root: d.put(
            root, d.TASKS, d.pq.read_table(root / d.TASKS), "task", d.pa.array(["drop the ball"])
        ),
    ),
    d.Damage("episodes table says drop the ball", "sentences", d.entry("tasks", lambda _: ["drop the ball"])),
    d.Damage(
        "stats.json: action mean * 1000",
        "statistics of the dataset",
        d.stats(lambda s: s["action"].update(mean=[1000 * v for v in s["action"]["mean"]])),
    ),
    d.Damage("stats.json deleted", "files", d.gone("meta/stats.json")),
    d.Damage(
        "info depth_unit mm -> m",
        "schema",
        d.info(d.setting(("features", d.FRONT_DEPTH, "info", "depth_unit"), "m")),
    ),
    d.Damage("info robot_type so100", "description", d.fields(robot_type="so100")),
    d.Damage("info splits train 0:2", "description", d.fields(splits={"train": "0:2"})),
    d.Damage("info splits test 0:3", "description", d.fields(splits={"test": "0:3"})),
    d.Damage("info total_tasks 9", "description", d.fields(total_tasks=9)),
    d.Damage("info fps 20 -> 10", "description", d.fields(fps=10)),
    d.Damage("info without fps", "description", d.info(d.without("fps"))),
    d.Damage("info without features", "schema", d.info(d.without("features"))),
    d.Damage("info is a list", "schema", d.info(lambda _: [])),
    d.Damage("info front without shape", "schema", d.info(d.without("features", d.FRONT, "shape"))),
    d.Damage("info data_path with {x}", "description", d.fields(data_path="data/{x}.parquet")),
    d.Damage("truncated data parquet", "table columns", d.truncated(d.FIRST)),
    d.Damage("tasks.parquet deleted", "files", d.gone(d.TASKS)),
    d.Damage("provenance: command changed", "plan", d.provenance(d.setting(("command",), "rm -rf /"))),
    d.Damage("provenance: settings changed", "plan", d.provenance(d.setting(("settings", "first_seed"), 7))),
    d.Damage("provenance: settings emptied", "plan", d.provenance(d.setting(("settings",), {}))),
    d.Damage(
        "provenance: skipped invented",
        "plan",
        d.provenance(
            lambda p: p["skipped"].append(
                {"task": "lift_ball", "variation": 0, "split": "train", "seed": 9, "reason": "x"}
            )
        ),
    ),
    d.Damage("README.md replaced", "card", d.content("README.md", b"# mine\n")),
    d.Damage("stray data file", "files", d.copied(d.FIRST, "data/chunk-000/file-002.parquet")),
    d.Damage("rows of an unlisted episode", "order of rows", d.rows(d.foreign_rows)),
    d.Damage("dataset_from_index -> 0", "table of episodes", d.entry("dataset_from_index", lambda _: 0)),
    d.Damage("episodes change places in their file", "order of rows", d.rows(d.exchanged_episodes)),
    d.Damage("null in tick", "readable", d.with_nulls("tick")),
    d.Damage("null in task_name", "readable", d.with_nulls("task_name")),
    d.Damage("null in state", "readable", d.with_nulls("observation.state")),
    d.Damage(
        "action of a row + 1e-6",
        "replayed actions",
        d.column("action", d.at(2, d.element(1, lambda v: v + 1e-6))),
    ),
    d.Damage("all actions 0.123", "replayed actions", d.column("action", d.each(lambda v: [0.123] * len(v)))),
    d.Damage(
        "one PNG is a bomb",
        "images complete",
        d.column(d.FRONT, d.at(1, d.png_of(60_000, 60_000))),
        d.KEYFRAMES,
    ),
    d.Damage(
        "depth shifted by 100 mm",
        "rendered depth",
        d.pixels(d.FRONT_DEPTH, lambda z: z + 100),
        d.KEYFRAMES,
    ),
    d.Damage("depth halved", "rendered depth", d.pixels(d.FRONT_DEPTH, lambda z: z // 2), d.KEYFRAMES),
    d.Damage("front and wrist exchanged", "rendered RGB", d.swapped(d.FRONT, d.WRIST)),
    d.Damage("last tick + 1000", "replay", d.column("tick", d.at(-1, lambda v: v + 1000)), d.KEYFRAMES),
    d.Damage(
        "garbage in the last state",
        "replayed observations",
        d.column("observation.state", d.at(-1, lambda v: [9.0] * len(v))),
    ),
)
