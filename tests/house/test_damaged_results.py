"""A committed row of results with one thing wrong: each is found, named with its file, and then no page is written."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.results.statistics import SuccessRate
from lerobot_env_bimanual.commands.results_report import ResultsReportConfig, results_report

ROOT = Path(__file__).parents[2]
SISTER, DAMAGED = (f"handover_item_easy_{policy}_small_seed1000.json" for policy in ("peract2", "peract_lf"))

type Row = dict[str, Any]


@pytest.fixture
def results(tmp_path: Path) -> Path:
    """A committed row, one like it of another policy, and the worlds of the committed certificates beside them."""
    folder = tmp_path / "small"
    folder.mkdir()
    shutil.copy(ROOT / "results" / "leaderboard" / SISTER, folder)
    row = json.loads((folder / SISTER).read_text())
    row["policy"] = row["flags"]["policy.type"] = "peract_lf"
    (folder / DAMAGED).write_text(json.dumps(row))
    (tmp_path / "certificates").mkdir()
    worlds = json.loads((ROOT / "results" / "certificates" / "expert.json").read_text())["worlds"]
    (tmp_path / "certificates" / "expert.json").write_text(json.dumps({"worlds": worlds}))
    return folder


def setting(*place: Any, value: Any) -> Callable[[Row], None]:
    def damage(row: Any) -> None:
        for key in place[:-1]:
            row = row[key]
        row[place[-1]] = value

    return damage


def replaced(name: str, old: str, new: str) -> Callable[[Row], None]:
    def damage(row: Row) -> None:
        row["dataset"][name] = row["dataset"][name].replace(old, new)

    return damage


def shifted(who: str, by: int = 1) -> Callable[[Row], None]:
    def damage(row: Row) -> None:
        for episode in row[who]:
            episode["seed"] += by

    return damage


def fewer(who: str) -> Callable[[Row], None]:
    return lambda row: row[who].pop()


def validated_elsewhere(row: Row) -> None:
    for validation in row["validation"]:
        for episode in validation["episodes"]:
            episode["seed"] += 100


DAMAGES: dict[str, tuple[Callable[[Row], None], str]] = {
    "scored on train": (setting("split", value="train"), "'split' is 'train', but must be test"),
    "scored on val": (setting("split", value="val"), "'split' is 'val', but must be test"),
    "trained on test": (replaced("command", "--split=train", "--split=test"), "--split of its command"),
    "trained on another task": (
        replaced("command", "handover_item_easy", "lift_ball"),
        "dataset.repo_id must be 'benchmark/lift_ball'",
    ),
    "trained on a variation": (replaced("command", "=any", "=0"), "--variation of its command"),
    "trained on fewer": (lambda row: row["dataset"]["seeds"].pop(), "--episodes of its command"),
    "trained on one seed twice": (
        setting("dataset", "seeds", 1, value=0),
        "its seeds must be there and rise",
    ),
    "trained on other images": (setting("dataset", "image_size", value=64), "--image_size of its command"),
    "trained in another simulation": (setting("dataset", "versions", "mujoco", value="2"), "mujoco must be"),
    "trained on nothing": (setting("dataset", "seeds", value=[]), "its seeds must be there"),
    "no command": (setting("dataset", "command", value="'"), "--task of its command"),
    "scored in another simulation": (setting("versions", "frankik", value="2"), "frankik must be that of"),
    "no simulation": (lambda row: row["versions"].pop("mujoco"), "mujoco must be that of the dataset"),
    "another world": (setting("world", value="0" * 12), "world of handover_item_easy is '000000000000', but"),
    "no blind control": (setting("blind", value=[]), "'blind'.*must be on the seeds of the policy"),
    "blind on other seeds": (shifted("blind"), "'blind'.*must be on the seeds of the policy"),
    "blind on fewer seeds": (fewer("blind"), "'blind'.*must be on the seeds of the policy"),
    "blind on another variation": (
        setting("blind", 0, "variation", value=1),
        "'blind'.*each once per variation",
    ),
    "an expert's episodes as blind": (
        lambda row: row.update(blind=row["expert"]),
        "blind on handover_item_easy is",
    ),
    "no expert": (setting("expert", value=[]), "'expert'.*must be on the seeds of the policy"),
    "expert on other seeds": (shifted("expert"), "'expert'.*must be on the seeds of the policy"),
    "expert on fewer seeds": (fewer("expert"), "'expert'.*must be on the seeds of the policy"),
    "policy on other seeds": (shifted("episodes"), "'validation'.*must be on the same seeds"),
    "policy on fewer seeds": (fewer("episodes"), "'expert'.*must be on the seeds of the policy"),
    "a seed twice": (setting("episodes", 1, "seed", value=0), "nor repeat or leave out a seed"),
    "a worse checkpoint": (setting("checkpoint_step", value=750), "the best on val is that after 1500 steps"),
    "no checkpoint": (setting("checkpoint_step", value=1501), "the best on val is that after 1500 steps"),
    "a checkpoint not validated": (fewer("validation"), "'validation'.*must be of every checkpoint"),
    "validated on other seeds": (
        validated_elsewhere,
        "'validation'.*must be on the same seeds from [0-9]+ on",
    ),
    "nothing validated": (setting("validation", value=[]), "'validation'.*must be of every checkpoint"),
    "another recipe": (setting("recipe", value="paper"), "a file with this result must be named"),
    "another policy": (setting("policy", value="act"), "policy.type must be 'act'"),
    "another task": (setting("task", value="lift_ball"), "a file with this result must be named lift_ball"),
    "another variation": (setting("variation", value="0"), "'flags'.*dataset.repo_id"),
    "another training seed": (setting("flags", "seed", value="7"), "a file with this result must be named"),
    "more steps": (setting("flags", "steps", value="1600"), "'validation'.*must be of every checkpoint"),
    "a flag of its own": (setting("flags", "config_path", value="x"), "--train_flags sets --config_path"),
    "a flag of two lines": (setting("flags", "policy.x", value="a\nb"), "must hold flags of one line each"),
    "an impossible day": (setting("date", value="2026-02-30"), "'date' is '2026-02-30'"),
    "fewer successes": (setting("rates", "policy", "successes", value=48), "'rates' is .*but the episodes"),
    "an episode turned": (
        lambda row: _turn(row["episodes"][0]),
        "there must be a failure just if there is no success",
    ),
    "an expert's episode turned": (lambda row: _turn(row["expert"][0]), "'expert'.*a failure just if"),
    "an unknown policy": (
        lambda row: (row.update(policy="mine"), row["flags"].update({"policy.type": "mine"})),
        "a file with this result must be named handover_item_easy_mine",
    ),
}


def _turn(episode: Row) -> None:
    episode["success"] = not episode["success"]


def with_its_rates(row: Row) -> Row:
    """The row with the rates of its episodes, which whoever forges one would not forget."""
    for who, name in {"policy": "episodes", "expert": "expert", "blind": "blind"}.items():
        rate = SuccessRate(sum(episode["success"] for episode in row[name]), len(row[name]))
        interval = list(rate.interval)
        row["rates"][who] = {"successes": rate.successes, "trials": rate.trials, "wilson_95": interval}
    return row


def test_the_rows_are_good_before_they_are_damaged(results, tmp_path):
    results_report(ResultsReportConfig(results=results, output=tmp_path / "page.md"))
    assert "| `handover_item_easy` |" in (tmp_path / "page.md").read_text()


@pytest.mark.parametrize(("damage", "message"), DAMAGES.values(), ids=DAMAGES.keys())
def test_a_damage_is_named_with_its_file_and_no_page_is_written(damage, message, results, tmp_path):
    row = json.loads((results / DAMAGED).read_text())
    damage(row)
    if "rates" not in message:
        row = with_its_rates(row)
    (results / DAMAGED).write_text(json.dumps(row))
    with pytest.raises(BimanualError, match=rf"{DAMAGED}: .*{message}") as error:
        results_report(ResultsReportConfig(results=results, output=tmp_path / "page.md"))
    assert "\n" not in str(error.value)
    assert not (tmp_path / "page.md").exists()


def test_the_same_training_twice_is_refused(results):
    row = json.loads((results / DAMAGED).read_text())
    row["flags"]["seed"] = "7"
    (results / DAMAGED.replace("1000", "7")).write_text(json.dumps(row))
    with pytest.raises(BimanualError, match=r"it has the weights of .*json, so it is no other training"):
        results_report(ResultsReportConfig(results=results))
