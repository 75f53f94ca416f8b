"""Draw docs/failures.png: how PerAct2 loses an episode of the tasks that it solves least, beside the expert's.

Of each task the training that solved least, and of that the first failed episode whose kind of failure, as `blame` finds
it, is the most frequent one there. Everything is played again from the recorded actions, which `blame` compares with what
was recorded; no weights are needed.

Usage: failures_figure.py
"""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from statistics import fmean

from PIL import Image
from PIL.PngImagePlugin import PngInfo

from lerobot_bimanual.benchmark.leaderboard import read_rows
from lerobot_bimanual.benchmark.results import ResultRow
from lerobot_bimanual.canvas import DESCRIPTION
from lerobot_bimanual.evaluation.played_episode import PlayedEpisode
from lerobot_env_bimanual.audit.blame import Blame, Loser
from lerobot_env_bimanual.audit.blaming import blames_of
from lerobot_env_bimanual.audit.episodes import played_env
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.expert.replanning import expert_of
from lerobot_env_bimanual.expert.runner import Move, Player
from lerobot_env_bimanual.pictures.layout import GREEN, INK, RED, Panel, contact_sheet
from lerobot_env_bimanual.pictures.take import Take, take
from lerobot_env_bimanual.pictures.viewpoint import clearest_camera, close_up
from lerobot_env_bimanual.workers import WorkerPool
from lerobot_env_bimanual.world.rendering import Renderer

ROOT = Path(__file__).parents[1]
BOARD, OUTPUT = ROOT / "results/leaderboard", ROOT / "docs/failures.png"
POLICY, TASKS = "peract2", 3
LOSERS = (Loser.LEFT, Loser.RIGHT, Loser.EITHER, Loser.COORDINATION)
"""Those who lose by a keypose."""
SIZE = (480, 640)
SHRINK = 2
COLOURS = 128
"""Of the file's palette; a third of the bytes, and nobody sees the difference."""


def main() -> None:
    """Play, draw and write."""
    rows = worst_rows()
    panels, said = [], []
    with WorkerPool(0) as pool:
        for row in rows:
            failed = [episode for episode in row.evaluation.episodes if not episode.success]
            blame = typical(blames_of(row.evaluation, failed, pool))
            played = next(episode for episode in failed if episode.seed == blame.seed)
            panels += panels_of(row, played, blame)
            said.append(f"{row.task}: seed {played.seed}, {blame.failure_class}: {blame.fact}.")
    lines = (
        "A row per task: before the keypose that lost the episode, after it, and after the one of the same number",
        "in the expert's own episode; at the right how the policy's ended.",
    )
    sheet = contact_sheet("Lost by PerAct2", lines, panels, columns=4).reduce(SHRINK)
    text = PngInfo()
    text.add_text(DESCRIPTION, " ".join(said))
    sheet.quantize(COLOURS, Image.Quantize.MEDIANCUT).save(OUTPUT, pnginfo=text, optimize=True)


def worst_rows() -> list[ResultRow]:
    """The worst training on each of the tasks that all trainings together solve least, the worst task first."""
    trained: dict[str, list[ResultRow]] = {}
    for row in read_rows(BOARD).values():
        if row.learner == POLICY:
            trained.setdefault(row.task, []).append(row)
    worst = sorted(trained.values(), key=lambda rows: fmean(row.rates["policy"].rate for row in rows))
    return [min(rows, key=lambda row: row.rates["policy"].rate) for rows in worst[:TASKS]]


def typical(blames: list[Blame]) -> Blame:
    """The first of the most frequent kind, of those that some keypose lost."""
    lost = [blame for blame in blames if blame.loser in LOSERS]
    frequent, _ = Counter(blame.failure_class for blame in lost).most_common(1)[0]
    return next(blame for blame in lost if blame.failure_class == frequent)


def panels_of(row: ResultRow, played: PlayedEpisode, blame: Blame) -> Iterator[Panel]:
    """Four pictures of one episode."""
    lost = blame.last_recoverable
    assert lost is not None
    env = played_env(row.task, row.evaluation.options)
    policys = take(env, played.seed, player_of(played), played.variation)
    experts = take(env, played.seed, expert_of(env), played.variation)
    states = [
        policys.states[policys.moves[lost][1]],
        policys.states[_end(policys, lost)],
        experts.states[_end(experts, lost)],
        policys.states[-1],
    ]
    camera = clearest_camera(env.scene, states)
    env.scene.restore_state(states[2])
    window = close_up(env.scene, camera, *SIZE)
    texts = [
        (f"{row.task}, before", "", INK),
        (f"keypose {lost + 1} of {POLICY}", f"{blame.loser}", RED),
        (f"keypose {lost + 1} of the expert", "", GREEN),
        (f"the end of {POLICY}", f"{blame.failure_class}", RED),
    ]
    with Renderer(env.scene, (camera,), *SIZE, "high") as renderer:
        for state, text in zip(states, texts, strict=True):
            env.scene.restore_state(state)
            yield Panel(renderer.render()[camera][0][window], *text)
    env.close()


def player_of(played: PlayedEpisode) -> Player:
    """Somebody who plays the recorded actions."""

    def play(_: BimanualEnv) -> Iterator[Move]:
        for index, action in enumerate(played.action_list()):
            yield Move(f"keypose {index + 1}", action)

    return play


def _end(taken: Take, index: int) -> int:
    """Tick after a move."""
    starts = [start for _, start in taken.moves]
    return [*starts[1:], taken.outcome.ticks][index]


if __name__ == "__main__":
    main()
