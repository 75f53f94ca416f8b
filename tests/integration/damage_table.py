"""The damages of the audit of November 2026, and further ones."""

FLAG = 7
"""Place of the left gripper's flag in a keypose, and of the gripper in a joint action."""


def table(d):
    """All damages, made with the tools of `damages.py`, given as `d`."""
    audit = (
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
        d.Damage(
            "labels' quaternions negated", "forms", d.column("observation.next_keypose", d.each(d.negated))
        ),
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
        d.Damage(
            "episodes table says drop the ball", "sentences", d.entry("tasks", lambda _: ["drop the ball"])
        ),
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
        d.Damage(
            "provenance: settings changed", "plan", d.provenance(d.setting(("settings", "first_seed"), 7))
        ),
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
        d.Damage(
            "all actions 0.123", "replayed actions", d.column("action", d.each(lambda v: [0.123] * len(v)))
        ),
        d.Damage(
            "one PNG is a bomb",
            "images complete",
            d.column(d.FRONT, d.at(1, _png(d, 60_000, 60_000))),
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
    return audit + _further(d)


def _further(d):
    video = f"videos/{d.FRONT}"
    mp4 = f"{video}/chunk-000/file-000.mp4"
    return (
        d.Damage("a vector loses a number to the next row", "readable", d.rows(d.one_of_list)),
        d.Damage(
            "actions as doubles",
            "table columns",
            d.rows(lambda t: _cast(d, t, "action", d.pa.list_(d.pa.float64()))),
        ),
        d.Damage("tick as text", "table columns", d.rows(lambda t: _cast(d, t, "tick", d.pa.string()))),
        d.Damage("column seed dropped", "table columns", d.rows(lambda t: t.drop_columns(["seed"]))),
        d.Damage(
            "a further column", "table columns", d.rows(lambda t: t.append_column("reward", t["timestamp"]))
        ),
        d.Damage("all rows of episode 1 dropped", "order of rows", d.rows(lambda t: t.slice(0, 5))),
        d.Damage("a row doubled", "order of rows", d.rows(lambda t: d.pa.concat_tables([t, t.slice(3, 1)]))),
        d.Damage("data file without rows", "order of rows", d.rows(lambda t: t.slice(0, 0))),
        d.Damage("data file is text", "table columns", d.content(d.FIRST, b"hello")),
        d.Damage("data file empty", "table columns", d.content(d.FIRST, b"")),
        d.Damage("second data file deleted", "files", d.gone(d.SECOND)),
        d.Damage(
            "episode_index of a row 0", "order of rows", d.column("episode_index", d.at(0, lambda _: 0))
        ),
        d.Damage("seed of all rows 77", "episode key", d.column("seed", d.each(lambda _: 77))),
        d.Damage("split of all rows test", "episode key", d.column("split", d.each(lambda _: "test"))),
        d.Damage("split of all rows moon", "episode key", d.column("split", d.each(lambda _: "moon"))),
        d.Damage("task of all rows unknown", "episode key", d.column("task_name", d.each(lambda _: "dance"))),
        d.Damage(
            "task of one row another", "episode key", d.column("task_name", d.at(3, lambda _: "push_box"))
        ),
        d.Damage("state hash of one row flipped", "replay", d.column("state_hash", d.at(2, lambda v: v ^ 1))),
        d.Damage("tick of the first row 1", "rows", d.column("tick", d.at(0, lambda _: 1))),
        d.Damage(
            "NaN in a state",
            "rows",
            d.column("observation.state", d.at(2, d.element(3, lambda _: float("nan")))),
        ),
        d.Damage(
            "infinite action", "rows", d.column("action", d.at(2, d.element(3, lambda _: float("inf"))))
        ),
        d.Damage("a keyframe too many", "keyframes", d.column("keyframe", d.at(0, lambda _: True))),
        d.Damage("last keyframe missing", "keyframes", d.column("keyframe", d.at(-1, lambda _: False))),
        d.Damage(
            "keypose step jumps", "keyframes", d.column("observation.keypose_step", d.at(-1, lambda v: v + 2))
        ),
        d.Damage(
            "keypose step starts at 1 everywhere",
            "keyframes",
            d.column("observation.keypose_step", d.each(lambda v: v + 1)),
        ),
        d.Damage(
            "label moved in one row",
            "labels",
            d.column("observation.next_keypose", d.at(1, d.element(0, lambda v: v + 0.01))),
        ),
        d.Damage(
            "label moved by a centimetre in all rows",
            "replayed keyposes",
            d.column("observation.next_keypose", d.each(d.element(0, lambda v: v + 0.01))),
        ),
        d.Damage(
            "label's quaternion of length 2",
            "forms",
            d.column(
                "observation.next_keypose", d.each(lambda v: [*v[:3], *(2 * q for q in v[3:7]), *v[7:]])
            ),
        ),
        d.Damage(
            "joint target beyond its limit",
            "actions",
            d.column("action", d.at(2, d.element(0, lambda _: 9.0))),
        ),
        d.Damage(
            "intrinsics doubled",
            "replayed observations",
            d.column("observation.camera_intrinsics", d.each(lambda v: [2 * k for k in v])),
        ),
        d.Damage(
            "one extrinsic moved",
            "calibration",
            d.column("observation.camera_extrinsics", d.at(2, d.element(3, lambda v: v + 0.1))),
        ),
        d.Damage(
            "fingers zero",
            "replayed observations",
            d.column("observation.gripper_fingers", d.each(lambda v: [0.0] * 4)),
        ),
        d.Damage("info fps true", "description", d.fields(fps=True)),
        d.Damage("info fps 1e9", "description", d.fields(fps=10**9)),
        d.Damage("info fps negative", "description", d.fields(fps=-20)),
        d.Damage("info codebase_version v2.1", "description", d.fields(codebase_version="v2.1")),
        d.Damage("info total_frames", "description", d.fields(total_frames=20)),
        d.Damage("info total_episodes text", "description", d.fields(total_episodes="3")),
        d.Damage("info with tools", "description", d.fields(tools=[{"name": "rm"}])),
        d.Damage("info chunks_size 1", "description", d.fields(chunks_size=1)),
        d.Damage("info data_path outside", "description", d.fields(data_path="../{chunk_index}{file_index}")),
        d.Damage(
            "info data_path of attributes", "description", d.fields(data_path="{chunk_index.__class__}")
        ),
        d.Damage("info data_path a number", "description", d.fields(data_path=3)),
        d.Damage("info without action", "schema", d.info(d.without("features", "action"))),
        d.Damage("info features[front] a text", "schema", d.info(d.setting(("features", d.FRONT), "image"))),
        d.Damage(
            "info images of 10^6 pixels",
            "schema",
            d.info(d.setting(("features", d.FRONT, "shape"), [10**6, 10**6, 3])),
        ),
        d.Damage(
            "info front is depth",
            "schema",
            d.info(d.setting(("features", d.FRONT, "info"), {"is_depth_map": True})),
        ),
        d.Damage(
            "info depth is no depth", "schema", d.info(d.setting(("features", d.FRONT_DEPTH, "info"), None))
        ),
        d.Damage(
            "info names of state reversed",
            "schema",
            d.info(lambda i: i["features"]["observation.state"]["names"].reverse()),
        ),
        d.Damage(
            "info schema version 9",
            "schema",
            d.info(d.setting(("features", "task_name", "info"), {"bimanual_schema_version": 9})),
        ),
        d.Damage("info not UTF-8", "description", d.content("meta/info.json", b"\xff\xfe{")),
        d.Damage("info deeply nested", "description", d.content("meta/info.json", b"[" * 10**5)),
        d.Damage(
            "depth range of the video 4 -> 8 m",
            "schema",
            d.info(d.setting(("features", d.FRONT_DEPTH, "info", "video.depth_max"), 8.0)),
            d.FRAMES,
        ),
        d.Damage(
            "depth of the video logarithmic",
            "schema",
            d.info(d.setting(("features", d.FRONT_DEPTH, "info", "video.use_log"), True)),
            d.FRAMES,
        ),
        d.Damage("stats.json a list", "statistics of the dataset", d.stats(lambda _: [])),
        d.Damage("stats.json without action", "statistics of the dataset", d.stats(d.without("action"))),
        d.Damage(
            "stats.json: std of state 0",
            "statistics of the dataset",
            d.stats(d.setting(("observation.state", "std"), [0.0] * 16)),
        ),
        d.Damage(
            "stats.json: count + 1",
            "statistics of the dataset",
            d.stats(lambda s: s["tick"]["count"].__setitem__(0, 1)),
        ),
        d.Damage(
            "stats.json: mean of texts",
            "statistics of the dataset",
            d.stats(d.setting(("action", "mean"), ["a"] * 16)),
        ),
        d.Damage(
            "stats.json: ragged mean",
            "statistics of the dataset",
            d.stats(d.setting(("action", "mean"), [[1], [1, 2]])),
        ),
        d.Damage(
            "stats.json: depth in metres",
            "statistics of the dataset",
            d.stats(lambda s: s[d.FRONT_DEPTH].update(mean=[[[0.9]]])),
        ),
        d.Damage("stats.json not UTF-8", "statistics of the dataset", d.content("meta/stats.json", b"\xff")),
        d.Damage(
            "statistics of an episode changed",
            "statistics",
            d.entry("stats/action/mean", lambda v: [x + 0.01 for x in v]),
        ),
        d.Damage(
            "image statistics of an episode changed",
            "statistics",
            d.entry(f"stats/{d.FRONT_DEPTH}/max", lambda _: [[[5.0]]]),
        ),
        d.Damage("entry of an episode dropped", "description", d.rows(lambda t: t.slice(0, 2), d.ENTRIES)),
        d.Damage(
            "entry of an episode doubled",
            "description",
            d.rows(lambda t: d.pa.concat_tables([t, t.slice(1, 1)]), d.ENTRIES),
        ),
        d.Damage(
            "entries in another order", "files of episodes", d.rows(lambda t: t.take([1, 0, 2]), d.ENTRIES)
        ),
        d.Damage("table of episodes truncated", "table of episodes", d.truncated(d.ENTRIES)),
        d.Damage(
            "table of episodes with a further column",
            "table of episodes",
            d.rows(lambda t: t.append_column("x", t["length"]), d.ENTRIES),
        ),
        d.Damage("length of an episode - 1", "order of rows", d.entry("length", lambda v: v - 1)),
        d.Damage("length of an episode null", "table of episodes", d.entry("length", lambda _: None)),
        d.Damage("tasks of an episode empty", "readable", d.entry("tasks", lambda _: [])),
        d.Damage("tasks of an episode two", "readable", d.entry("tasks", lambda v: [*v, "and wave"])),
        d.Damage("file index of an episode 1", "order of rows", d.entry("data/file_index", lambda _: 1)),
        d.Damage("file index of an episode -1", "files", d.entry("data/file_index", lambda _: -1)),
        d.Damage(
            "meta file index of an episode 5",
            "files of episodes",
            d.entry("meta/episodes/file_index", lambda _: 5),
        ),
        d.Damage(
            "video begins a tick late",
            "table of episodes",
            d.entry(f"{video}/from_timestamp", lambda v: v + 0.05),
            d.FRAMES,
        ),
        d.Damage(
            "video begins never",
            "table of episodes",
            d.entry(f"{video}/from_timestamp", lambda _: float("nan")),
            d.FRAMES,
        ),
        d.Damage(
            "video ends early",
            "table of episodes",
            d.entry(f"{video}/to_timestamp", lambda v: v - 0.5),
            d.FRAMES,
        ),
        d.Damage(
            "video in another file",
            "table of episodes",
            d.entry(f"{video}/file_index", lambda _: 1),
            d.FRAMES,
        ),
        d.Damage("video missing", "files", d.gone(mp4), d.FRAMES),
        d.Damage("video truncated", "images complete", d.truncated(mp4), d.FRAMES),
        d.Damage("video is text", "images complete", d.content(mp4, b"moov"), d.FRAMES),
        d.Damage("stray video", "files", d.copied(mp4, f"{video}/chunk-000/file-009.mp4"), d.FRAMES),
        d.Damage("image null", "images complete", d.column(d.FRONT, d.at(1, lambda _: None)), d.KEYFRAMES),
        d.Damage(
            "image is text",
            "images complete",
            d.column(d.FRONT, d.at(1, lambda c: c | {"bytes": b"x"})),
            d.KEYFRAMES,
        ),
        d.Damage(
            "image of another size",
            "images complete",
            d.column(d.FRONT, d.at(1, _png(d, 33, 24))),
            d.KEYFRAMES,
        ),
        d.Damage(
            "image cut off",
            "images complete",
            d.column(d.FRONT, d.at(1, lambda c: c | {"bytes": c["bytes"][:60]})),
            d.KEYFRAMES,
        ),
        d.Damage(
            "images mirrored", "rendered RGB", d.pixels(d.FRONT, lambda p: p[:, ::-1].copy()), d.KEYFRAMES
        ),
        d.Damage(
            "red and blue exchanged",
            "rendered RGB",
            d.pixels(d.FRONT, lambda p: p[..., ::-1].copy()),
            d.KEYFRAMES,
        ),
        d.Damage(
            "images grey", "images complete", d.pixels(d.FRONT, lambda p: p[..., 0].copy()), d.KEYFRAMES
        ),
        d.Damage(
            "sentences numbered from 1",
            "sentences",
            lambda root: d.put(root, d.TASKS, d.pq.read_table(root / d.TASKS), "task_index", d.pa.array([1])),
        ),
        d.Damage(
            "sentences without their text", "sentences", d.rows(lambda t: t.drop_columns(["task"]), d.TASKS)
        ),
        d.Damage("provenance deleted", "provenance", d.gone("meta/bimanual.json")),
        d.Damage("provenance a list", "provenance", d.provenance(lambda _: [])),
        d.Damage("provenance not UTF-8", "provenance", d.content("meta/bimanual.json", b"\xff")),
        d.Damage(
            "provenance of the other view", "provenance", d.provenance(lambda p: p.update(view="video"))
        ),
        d.Damage(
            "provenance lists an episode twice",
            "provenance",
            d.provenance(lambda p: p["episodes"].append(p["episodes"][0])),
        ),
        d.Damage(
            "provenance exchanges two episodes", "plan", d.provenance(lambda p: p["episodes"].reverse())
        ),
        d.Damage(
            "provenance without a version", "provenance", d.provenance(d.without("versions", "lerobot"))
        ),
        d.Damage(
            "provenance asks for larger images",
            "provenance",
            d.provenance(d.setting(("settings", "height"), 512)),
        ),
        d.Damage(
            "provenance asks for another camera",
            "provenance",
            d.provenance(d.setting(("settings", "cameras"), ["front"])),
        ),
        d.Damage(
            "provenance asks for 10^12 episodes",
            "plan",
            d.provenance(d.setting(("settings", "episodes"), 10**12)),
        ),
        d.Damage(
            "provenance rounds keyposes",
            "replayed keyposes",
            d.provenance(
                lambda p: p.update(
                    settings=p["settings"] | {"discretise": 100},
                    command=p["command"].replace("--discretise=0", "--discretise=100"),
                )
            ),
        ),
        d.Damage(
            "card promises more episodes",
            "card",
            lambda root: (root / "README.md").write_text(
                (root / "README.md").read_text().replace("3 episodes", "300 episodes")
            ),
        ),
        d.Damage("card not UTF-8", "card", d.content("README.md", b"\xff\xfe")),
        d.Damage("program beside the data", "files", d.content("lift_ball.py", b"import os")),
    )


def _png(d, width: int, height: int):
    return lambda cell: cell | {"bytes": d.png(width, height)}


def _cast(d, table, key, kind):
    return table.set_column(table.column_names.index(key), key, table[key].cast(kind))


HARMLESS = {
    "picture replaced": "nobody learns from the picture of the card, and the seal knows it",
    "reason of a skipped seed": "words for people; nothing reads them, and the seal knows them",
    "version of LeRobot in the provenance": "no seed depends on it; columns and videos are compared themselves",
    "columns in another order": "every reader takes them by name",
    "rows compressed otherwise": "they decode to the same numbers",
    "statistics off by rounding": "float32 does not hold the difference",
}
"""Changes that no check finds when the seal is made again, and why that does not matter."""
