"""Certificates with one thing wrong: each is found, named with its file, and then no page is written."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.json_record import decode
from lerobot_env_bimanual.commands.report import ReportConfig, report
from lerobot_env_bimanual.expert.certificate import Certificate
from lerobot_env_bimanual.expert.stored_certificate import EVIDENCE, MEASURED, StoredEpisode
from lerobot_env_bimanual.reports.certified import CERTIFICATES

COMMITTED = Path(__file__).parents[2] / "results" / "certificates"
TASKS = ("lift_ball", "dual_push_buttons")
SEEDS = range(61000, 61003)

type Content = dict[str, Any]


@pytest.fixture(scope="module")
def excerpts() -> dict[str, Content]:
    """The committed certificates, cut down to two tasks and three seeds, by name."""
    return {path.stem: excerpt(json.loads(path.read_text())) for path in COMMITTED.glob("*.json")}


def excerpt(content: Content) -> Content:
    episodes = [
        episode for episode in content["episodes"] if episode["task"] in TASKS and episode["seed"] in SEEDS
    ]
    outcomes = tuple(
        decode(StoredEpisode, dict.fromkeys(EVIDENCE) | episode, "episode").outcome("test")
        for episode in episodes
    )
    head = {name: content[name] for name in ("control", "discretise", "replay", "split")}
    seeds = f"{SEEDS.start}:{SEEDS.stop}"
    campaign = Certificate(**head, seeds=seeds, outcomes=outcomes)
    whole = {(row["task"], row["variation"]): row for row in content["rates"]}
    rates = campaign.rate_rows()
    for row in rates:
        measured = whole[row["task"], row["variation"]]
        row |= {name: measured[name] for name in MEASURED if name in measured}
    worlds = {task: world for task, world in content["worlds"].items() if task in TASKS}
    fewer = {"seeds": seeds, "worlds": worlds, "complaints": campaign.complaints, "rates": rates}
    return json.loads(json.dumps(content | fewer | {"episodes": episodes}))


def setting(*place: Any, value: Any) -> Callable[[Content], None]:
    """A damage that sets one value."""

    def damage(content: Content) -> None:
        for key in place[:-1]:
            content = content[key]
        content[place[-1]] = value

    return damage


def without(*place: Any) -> Callable[[Content], None]:
    """A damage that takes one value away."""

    def damage(content: Content) -> None:
        for key in place[:-1]:
            content = content[key]
        del content[place[-1]]

    return damage


def other_seeds(content: Content) -> None:
    content["seeds"] = "61001:61004"
    for episode in content["episodes"]:
        episode["seed"] += 1


def one_episode_twice(content: Content) -> None:
    content["episodes"][1] = content["episodes"][0]


def one_task_left_out(content: Content) -> None:
    for name in ("episodes", "rates"):
        content[name] = [row for row in content[name] if row["task"] != "lift_ball"]


def one_variation_left_out(content: Content) -> None:
    for name in ("episodes", "rates"):
        content[name] = [row for row in content[name] if row["variation"] != 4]


def one_variation_only(content: Content) -> None:
    for name in ("episodes", "rates"):
        content[name] = [row for row in content[name] if row["variation"] == 0]


DAMAGES: dict[str, tuple[str, Callable[[Content], None], str]] = {
    "another control": ("random", setting("control", value="noop"), "control is 'noop', but must be random"),
    "no control": (
        "blind",
        setting("control", value="sleeping"),
        "control is 'sleeping', but must be one of",
    ),
    "rounded is exact": ("expert_discretised", setting("discretise", value=0), "discretise is 0"),
    "exact is rounded": ("expert", setting("discretise", value=100), "discretise is 100, but must be 0"),
    "negative voxels": ("expert_discretised", setting("discretise", value=-1), "discretise is -1"),
    "another split": ("blind", setting("split", value="val"), "split is 'val', but must be test"),
    "no split": ("blind", setting("split", value="holdout"), "split is 'holdout', but must be one of"),
    "no replay": ("expert", setting("replay", value="none"), "replayed is True, but must be known just if"),
    "range of seeds": ("random", setting("seeds", value="61000:61002"), "seed 61002 is not among"),
    "longer range of seeds": ("random", setting("seeds", value="61000:61004"), "0 on seed 61003"),
    "endless range of seeds": ("random", setting("seeds", value="61000:999999999"), "0 on seed 61003"),
    "no range of seeds": ("random", setting("seeds", value="all"), "seeds is 'all'"),
    "other seeds": ("noop", other_seeds, "seeds is '61001:61004', but must be 61000:61003"),
    "other seeds of an expert": ("expert_discretised", other_seeds, "seeds is '61001:61004'"),
    "another MuJoCo": ("noop", setting("versions", "mujoco", value="3.16.0"), "versions is .*3.16.0"),
    "no MuJoCo": ("noop", without("versions", "mujoco"), "versions is of .* but must be of frankik"),
    "another world": ("noop", setting("worlds", "lift_ball", value="0" * 12), "worlds is .*'000000000000'"),
    "a world of no form": ("noop", setting("worlds", "lift_ball", value="new"), "worlds.lift_ball is 'new'"),
    "a world too few": ("noop", without("worlds", "lift_ball"), "worlds is of .*but the episodes are of"),
    "an unknown task": (
        "noop",
        setting("worlds", "juggle", value="0" * 12),
        "worlds holds 'juggle', but tasks",
    ),
    "an episode of an unknown task": ("noop", setting("episodes", 0, "task", value="juggle"), "worlds is of"),
    "an unknown variation": (
        "noop",
        setting("episodes", -1, "variation", value=9),
        "variation is 9.* 0 to 0",
    ),
    "another variation": ("blind", setting("episodes", 0, "variation", value=1), "is there twice on seed"),
    "an episode missing": ("random", without("episodes", 0), "0 on seed 61000"),
    "an episode twice": ("random", one_episode_twice, "is there twice on seed 61000"),
    "a task missing": ("noop", one_task_left_out, "worlds is of"),
    "a variation missing": ("expert_discretised", one_variation_left_out, "there are 4 on seed 61000"),
    "one variation only": ("expert_discretised", one_variation_only, "variations is 'some only'"),
    "no episodes": ("noop", setting("episodes", value=[]), "worlds is of"),
    "a success invented": ("noop", setting("episodes", 0, "success", value=True), "failure is 'out of time'"),
    "a failure invented": ("expert", setting("episodes", 0, "success", value=False), "just if an expert"),
    "conditions unmet in a success": (
        "expert",
        setting("episodes", 0, "unmet", value=["above(ball, 0.95)"]),
        "unmet is .*but must be empty in a success",
    ),
    "other ticks": ("blind", setting("episodes", 0, "ticks", value=7), "ticks is 7, but must be those of"),
    "another last move": ("blind", setting("episodes", 0, "last_move", value="x"), "last_move is 'x'"),
    "negative draws": ("blind", setting("episodes", 0, "draws", value=-1), "draws is -1"),
    "a text for a number": ("blind", setting("episodes", 0, "seed", value="5"), r"episodes\[0\].seed is '5'"),
    "another hash": ("blind", setting("episodes", 0, "state_hash", value="?"), "state_hash is '\\?'"),
    "an unstable episode": (
        "noop",
        setting("episodes", 0, "unstable", value=True),
        "complaints is .*the simulation was unstable",
    ),
    "evidence for a control": ("noop", setting("episodes", 0, "replayed", value=None), "just if an expert"),
    "no evidence": ("expert", without("episodes", 0, "keyframes_found"), "just if an expert solved it"),
    "keyframes not found": (
        "expert",
        setting("episodes", 0, "keyframes_found", value=False),
        "keyframes_found is 3, but the episodes give 2",
    ),
    "a replay through other states": (
        "expert",
        setting("episodes", 0, "replayed", value=False),
        "replayed is 3, but the episodes give 2",
    ),
    "more successes": (
        "blind",
        setting("rates", 0, "successes", value=2),
        "successes is 2, but the episodes",
    ),
    "other trials": (
        "blind",
        setting("rates", 0, "trials", value=50),
        "trials is 50, but the episodes give 3",
    ),
    "another interval": ("blind", setting("rates", 0, "wilson_95", 1, value=0.1), "wilson_95 is"),
    "another median": ("expert", setting("rates", 0, "median_s", value=1.0), "median_s is 1.0, but the epi"),
    "a smaller tip error": (
        "expert_discretised",
        setting("rates", -1, "worst_tip_error_mm", value=0.0),
        "worst_tip_error_mm is 0.0, but the episodes give",
    ),
    "a row missing": ("blind", without("rates", 0), "rates is of"),
    "a row twice": ("blind", lambda content: content["rates"].append(content["rates"][0]), "rates is of"),
    "a field of a row missing": ("expert", without("rates", 0, "acceptance"), "its fields are"),
    "no coupling": ("expert", without("rates", 0, "coupling"), "coupling must be there"),
    "an impossible coupling": (
        "expert",
        setting("rates", 0, "coupling", "speed_correlation", value=1.5),
        "coupling.speed_correlation is 1.5, but must be from -1 to 1",
    ),
    "no strain": ("expert", without("rates", 0, "strain"), "strain must be there"),
    "a strain of no numbers": (
        "expert",
        setting("rates", 0, "strain", "torque", value="NaN"),
        "strain.torque is 'NaN'",
    ),
    "an impossible strain": (
        "expert",
        setting("rates", 0, "strain", "velocity", value=-0.5),
        "strain.velocity is -0.5, but must be at least 0",
    ),
    "a strain that nobody complained of": (
        "expert",
        setting("rates", 0, "strain", "contact_force_n", value=554.0),
        "strain.contact_force_n is 554, but must be at most 100, and complaints does not say so",
    ),
    "bodies in each other without depth": (
        "expert",
        setting("rates", 0, "strain", "penetration_mm", value=0.0),
        "strain.penetrating is .*but must name two bodies",
    ),
    "a coupling of text": ("expert", setting("rates", 0, "coupling", value="much"), "coupling is 'much'"),
    "a complaint": ("noop", setting("complaints", value="none"), "complaints is 'none', but must be a list"),
    "a field missing": ("noop", without("replay"), "certificate lacks replay"),
    "a field too many": ("noop", setting("remark", value="good"), "certificate has unknown remark"),
    "a row of something else": ("noop", setting("rates", 0, value=[]), r"rates\[0\] is \[\]"),
}


def folder_of(excerpts: dict[str, Content], folder: Path) -> Path:
    folder.mkdir()
    for name, content in excerpts.items():
        (folder / f"{name}.json").write_text(json.dumps(content))
    return folder


def refused(folder: Path, name: str, message: str) -> None:
    page = folder.parent / "page.md"
    with pytest.raises(BimanualError, match=rf"{name}\.json: .*{message}") as error:
        report(ReportConfig(certificates=folder, output=page))
    assert "\n" not in str(error.value)
    assert not page.exists()


def test_a_page_is_made_of_certificates_without_damage(excerpts, tmp_path):
    folder = folder_of(excerpts, tmp_path / "folder")
    unseen = tmp_path / "none.json"
    report(ReportConfig(certificates=folder, visibility=unseen, output=tmp_path / "page.md"))
    assert "| `dual_push_buttons` | 15/15 | 15/15 | 0/15 |" in (tmp_path / "page.md").read_text()


@pytest.mark.parametrize(("name", "damage", "message"), DAMAGES.values(), ids=DAMAGES.keys())
def test_a_damage_is_named_with_its_file_and_no_page_is_written(name, damage, message, excerpts, tmp_path):
    damaged = json.loads(json.dumps(excerpts[name]))
    damage(damaged)
    refused(folder_of(excerpts | {name: damaged}, tmp_path / "folder"), name, message)


@pytest.mark.parametrize("name", CERTIFICATES)
def test_the_certificate_of_another_is_refused_under_any_name(name, excerpts, tmp_path):
    for other in set(excerpts) - {name}:
        if name in excerpts:
            folder = folder_of(excerpts | {name: excerpts[other]}, tmp_path / other)
            refused(
                folder,
                name if name != "expert" else "expert.*",
                "(control|discretise|replay|seeds|variations)",
            )


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"\xff{}", b"[" * 100_000, b'{"control": "blind"}'])
def test_what_is_no_certificate_is_refused(content, excerpts, tmp_path):
    folder = folder_of(excerpts, tmp_path / "folder")
    (folder / "blind.json").write_bytes(content)
    refused(folder, "blind", "")


def test_a_truncated_certificate_is_refused(excerpts, tmp_path):
    folder = folder_of(excerpts, tmp_path / "folder")
    path = folder / "random.json"
    path.write_text(path.read_text()[:-50])
    refused(folder, "random", "must be JSON")


def test_a_certificate_under_the_name_of_none_is_refused(excerpts, tmp_path):
    folder = folder_of(excerpts, tmp_path / "folder")
    (folder / "noop.json").rename(folder / "nop.json")
    with pytest.raises(
        BimanualError, match=r"nop\.json has the name of no certificate; those are: expert\.json"
    ):
        report(ReportConfig(certificates=folder))
