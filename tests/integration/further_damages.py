"""Damages that nobody had planted before, and what finds them."""

import damages as d

VIDEO = f"videos/{d.FRONT}"
MP4 = f"{VIDEO}/chunk-000/file-000.mp4"


def _cast(table, key, kind):
    return table.set_column(table.column_names.index(key), key, table[key].cast(kind))


FURTHER = (
    d.Damage("a vector loses a number to the next row", "readable", d.rows(d.one_of_list)),
    d.Damage(
        "actions as doubles",
        "table columns",
        d.rows(lambda t: _cast(t, "action", d.pa.list_(d.pa.float64()))),
    ),
    d.Damage("tick as text", "table columns", d.rows(lambda t: _cast(t, "tick", d.pa.string()))),
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
    d.Damage("episode_index of a row 0", "order of rows", d.column("episode_index", d.at(0, lambda _: 0))),
    d.Damage("seed of all rows 77", "episode key", d.column("seed", d.each(lambda _: 77))),
    d.Damage("split of all rows test", "episode key", d.column("split", d.each(lambda _: "test"))),
    d.Damage("split of all rows moon", "episode key", d.column("split", d.each(lambda _: "moon"))),
    d.Damage("task of all rows unknown", "episode key", d.column("task_name", d.each(lambda _: "dance"))),
    d.Damage("task of one row another", "episode key", d.column("task_name", d.at(3, lambda _: "push_box"))),
    d.Damage("state hash of one row flipped", "replay", d.column("state_hash", d.at(2, lambda v: v ^ 1))),
    d.Damage("tick of the first row 1", "rows", d.column("tick", d.at(0, lambda _: 1))),
    d.Damage(
        "NaN in a state",
        "rows",
        d.column("observation.state", d.at(2, d.element(3, lambda _: float("nan")))),
    ),
    d.Damage("infinite action", "rows", d.column("action", d.at(2, d.element(3, lambda _: float("inf"))))),
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
        d.column("observation.next_keypose", d.each(lambda v: [*v[:3], *(2 * q for q in v[3:7]), *v[7:]])),
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
    d.Damage("info data_path of attributes", "description", d.fields(data_path="{chunk_index.__class__}")),
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
    d.Damage("entries in another order", "files of episodes", d.rows(lambda t: t.take([1, 0, 2]), d.ENTRIES)),
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
        d.entry(f"{VIDEO}/from_timestamp", lambda v: v + 0.05),
        d.FRAMES,
    ),
    d.Damage(
        "video begins never",
        "table of episodes",
        d.entry(f"{VIDEO}/from_timestamp", lambda _: float("nan")),
        d.FRAMES,
    ),
    d.Damage(
        "video ends early",
        "table of episodes",
        d.entry(f"{VIDEO}/to_timestamp", lambda v: v - 0.5),
        d.FRAMES,
    ),
    d.Damage(
        "video in another file",
        "table of episodes",
        d.entry(f"{VIDEO}/file_index", lambda _: 1),
        d.FRAMES,
    ),
    d.Damage("video missing", "files", d.gone(MP4), d.FRAMES),
    d.Damage("video truncated", "images complete", d.truncated(MP4), d.FRAMES),
    d.Damage("video is text", "images complete", d.content(MP4, b"moov"), d.FRAMES),
    d.Damage("stray video", "files", d.copied(MP4, f"{VIDEO}/chunk-000/file-009.mp4"), d.FRAMES),
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
        d.column(d.FRONT, d.at(1, d.png_of(33, 24))),
        d.KEYFRAMES,
    ),
    d.Damage(
        "image cut off",
        "images complete",
        d.column(d.FRONT, d.at(1, lambda c: c | {"bytes": c["bytes"][:60]})),
        d.KEYFRAMES,
    ),
    d.Damage("images mirrored", "rendered RGB", d.pixels(d.FRONT, lambda p: p[:, ::-1].copy()), d.KEYFRAMES),
    d.Damage(
        "red and blue exchanged",
        "rendered RGB",
        d.pixels(d.FRONT, lambda p: p[..., ::-1].copy()),
        d.KEYFRAMES,
    ),
    d.Damage("images grey", "images complete", d.pixels(d.FRONT, lambda p: p[..., 0].copy()), d.KEYFRAMES),
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
    d.Damage("provenance of the other view", "provenance", d.provenance(lambda p: p.update(view="video"))),
    d.Damage(
        "provenance lists an episode twice",
        "provenance",
        d.provenance(lambda p: p["episodes"].append(p["episodes"][0])),
    ),
    d.Damage("provenance exchanges two episodes", "plan", d.provenance(lambda p: p["episodes"].reverse())),
    d.Damage("provenance without a version", "provenance", d.provenance(d.without("versions", "lerobot"))),
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
        "provenance asks for no depth", "provenance", d.provenance(d.setting(("settings", "depth"), False))
    ),
    d.Damage("provenance without a world", "provenance", d.provenance(d.without("worlds", "lift_ball"))),
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
