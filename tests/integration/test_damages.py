"""Every known damage of a dataset is found, by the check that is meant for it and by the seal; what is not is harmless."""

from collections.abc import Iterator
from pathlib import Path

import damages
import pyarrow.parquet as pq
import pytest
from audited_damages import AUDITED
from further_damages import FURTHER

from lerobot_bimanual.dataset.seal import seal_problems, write_seal
from lerobot_env_bimanual.verification.simulation import Player
from lerobot_env_bimanual.verification.verifier import Thoroughness, Verifier, verify_metadata

pytestmark = pytest.mark.sim


DAMAGES = (*AUDITED, *FURTHER)
OF_EPISODES = (
    "readable",
    "rows",
    "episode key",
    "keyframes",
    "actions",
    "forms",
    "labels",
    "calibration",
    "bookkeeping",
    "statistics",
    "images complete",
)


def cases() -> Iterator[object]:
    """Every damage in every view; slow where an episode has to be looked at, or another view was."""
    for damage in DAMAGES:
        for view in damage.views:
            is_quick = damage.check not in (*damages.SIMULATED, *OF_EPISODES) and view == damage.views[-1]
            marks = [] if is_quick else [pytest.mark.slow]
            yield pytest.param(damage, view, id=f"{view}: {damage.name}", marks=marks)


@pytest.fixture(scope="module")
def player() -> Iterator[Player]:
    player = Player()
    yield player
    player.close()


def findings(root: Path, check: str, player: Player) -> dict[str, str]:
    """Failed checks of the dataset and, unless the check is among them, of episode 1."""
    found = verify_metadata(root)
    if not found.get(check):
        simulate = check in damages.SIMULATED
        verifier = Verifier(root, Thoroughness(simulate, 3 if simulate else 0), player)
        found |= verifier.verify(1).faults
    return {name: "; ".join(fault.text for fault in faults) for name, faults in found.items() if faults}


@pytest.mark.parametrize(("damage", "view"), list(cases()))
def test_a_damage_is_found_by_its_check_even_where_the_seal_was_made_again(
    damage, view, copy, player
) -> None:
    root = copy(view)
    damage.change(root)
    assert list(seal_problems(root)), "the seal alone does not find it"
    write_seal(root)
    found = findings(root, damage.check, player)
    assert damage.check in found
    assert "seal" not in found
    assert "cannot be checked" not in found[damage.check]


def test_names_of_damages_are_names() -> None:
    names = [damage.name for damage in DAMAGES]
    assert len(set(names)) == len(names) >= 54 + 40


def rewrite_compressed(root: Path) -> None:
    path = root / damages.FIRST
    pq.write_table(pq.read_table(path), path, compression="zstd")


HARMLESS = {
    "nobody learns from the picture of the card": damages.content("meta/first_episode.jpg", b"none"),
    "no seed depends on LeRobot's version, and columns and videos are compared themselves": damages.provenance(
        damages.setting(("versions", "lerobot"), "9.9")
    ),
    "every reader takes columns by name": damages.rows(lambda table: table.select(table.column_names[::-1])),
    "files compressed otherwise hold the same numbers": rewrite_compressed,
    "float32 does not hold the difference": damages.entry(
        "stats/action/mean", lambda mean: [value + 1e-8 for value in mean]
    ),
}
"""Changes that only the seal finds, by the reason why that does not matter."""


@pytest.mark.slow
@pytest.mark.parametrize("reason", HARMLESS)
def test_what_only_the_seal_finds_is_listed_with_a_reason(reason, copy, player) -> None:
    root = copy("keyframes")
    HARMLESS[reason](root)
    assert list(seal_problems(root))
    write_seal(root)
    assert findings(root, "replay", player).keys() <= {"card"}


def test_no_cell_and_no_playlist_leads_to_another_file(copy, player, tmp_path, monkeypatch) -> None:
    secret = tmp_path / "secret.png"
    secret.write_bytes(damages.png(32, 24))
    cells, playlist = copy("keyframes"), copy("frames")
    damages.column(damages.FRONT, damages.at(1, lambda _: {"bytes": None, "path": str(secret)}))(cells)
    film = next(playlist.glob(f"videos/{damages.FRONT}/*/*.mp4"))
    film.write_text(f"#EXTM3U\n#EXTINF:1,\n{film.with_name('file-001.mp4')}\n#EXT-X-ENDLIST\n")
    opened = []
    monkeypatch.setattr("datasets.features.image.xopen", lambda *args, **_: opened.append(args))
    for root in (cells, playlist):
        write_seal(root)
        thoroughness = Thoroughness(simulate=False, rendered_rows=0, cache=tmp_path / "cache")
        faults = Verifier(root, thoroughness, player).verify(1 if root is cells else 0).faults
        assert faults["images complete"]
        assert "LeRobot's loader" not in faults
    assert not opened


def test_a_link_is_told_and_nothing_behind_it_is_read(copy, tmp_path) -> None:
    root = copy("keyframes")
    (root / "README.md").unlink()
    (root / "README.md").symlink_to("/dev/zero")
    found = verify_metadata(root)
    assert [*found] == ["readable"]
    assert "README.md" in found["readable"][0].text
