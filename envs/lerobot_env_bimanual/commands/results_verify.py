"""The command `results verify`."""

import secrets
from dataclasses import dataclass, field
from pathlib import Path

from lerobot_bimanual.errors import check_range
from lerobot_bimanual.terminal import say, show_next
from lerobot_env_bimanual.workers import WorkerPool


@dataclass
class ResultsVerifyConfig:
    """Flags of `results verify`."""

    # A file, or a folder of files: results of `policy benchmark`, or records that `lerobot-eval --env.results_dir` has left.
    results: Path = field(kw_only=True)
    sample: int = 0  # random episodes of each result; 0 takes all
    # seed of the random choice; by default another one in every run, which is printed
    sample_seed: int | None = None
    workers: int = 0  # processes; 0 takes one per core


def results_verify(config: ResultsVerifyConfig) -> int:
    """Replay the episodes of results without the policy and compare every claim.

    Each episode is replayed from its seed by the recorded actions: the state after every action must be the recorded one,
    bit for bit, and instruction, outcome, first tick of success, failure, ticks and keyposes must come out as claimed.
    Exits with 1 if anything differs, and says where first; that is inconclusive if it was recorded with another C library.
    Expert and baseline episodes of a result are those of the expert reports of the same world.

    Examples:
        lerobot-bimanual results verify --results=results/leaderboard
        lerobot-bimanual results verify --results=results/leaderboard --sample=5
        lerobot-bimanual results verify --results=outputs/eval/lift_ball_test_record.json
    """
    from lerobot_bimanual.distributions import libc_mismatch
    from lerobot_bimanual.results.record import result_paths
    from lerobot_env_bimanual.verification.episodes import EpisodeVerifier, map_episodes
    from lerobot_env_bimanual.verification.result_files import ResultFile, sample_episodes

    check_range("sample", config.sample, 0)
    seed = secrets.randbelow(2**32) if config.sample_seed is None else config.sample_seed
    check_range("sample_seed", seed, 0)
    if config.sample:
        print(f"episodes are drawn by --sample_seed={seed}")
    failed = False
    with WorkerPool(config.workers) as pool:
        for path in result_paths(config.results):
            result = ResultFile.read(path)
            episodes = sample_episodes(result.record.episodes, config.sample, seed)
            problems = [result.world_problem] if result.world_problem else []
            found = map_episodes(
                EpisodeVerifier,
                result.record,
                episodes,
                pool,
                "replay",
                failed=lambda _, why: [f"not replayed: {why}"],
            )
            of_episodes = zip(episodes, found, strict=True)
            problems += [f"seed {episode.seed}: {text}" for episode, texts in of_episodes for text in texts]
            verdict = "NOT as claimed" if problems else "as claimed"
            if problems and (other := libc_mismatch(result.record.versions)):
                verdict = f"inconclusive, {other}"
            say(f"{path}: {verdict}, {len(episodes)} episodes replayed", *(f"  {text}" for text in problems))
            failed |= bool(problems)
    if not failed:
        show_next("lerobot-bimanual", "results", "diagnose", f"--results={config.results}")
    return int(failed)
