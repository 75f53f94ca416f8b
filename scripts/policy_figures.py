"""Draw a figure of each policy, docs/<policy>.svg: what it reads, its networks, and what it answers.

Usage: policy_figures.py
"""

from pathlib import Path

from svg import arrow, box, svg, text

DOCS = Path(__file__).parents[1] / "docs"
INPUT, NETWORK, LEFT, RIGHT, BOTH = "#eef1f5", "#e3eefb", "#cfe5f5", "#fbdcc6", "#e4f1e2"
LINES = "#5a5e69"
WIDTH, HEIGHT, GAP_X, GAP_Y = 206, 62, 34, 30

type Block = tuple[int, float, str, str, str]
"""Column and row, two lines of text, colour."""
type Figure = tuple[str, list[Block], list[tuple[int, int]]]
"""Title, blocks, and arrows from block to block by their places in the list."""

EYES: list[Block] = [
    (0, 0, "five RGB-D images", "with calibration", INPUT),
    (0, 1, "instruction", "language tokens", INPUT),
    (0, 2, "fingers, keypose step", "8 numbers; 4 of one arm", INPUT),
]
ANSWER = "position, rotation, gripper, flag"

FIGURES: dict[str, Figure] = {
    "peract2": (
        "PerAct2: one network for both arms",
        [
            *EYES,
            (1, 0, "voxel grid", "100 x 100 x 100, 10 channels", NETWORK),
            (1, 2, "patches and words", "read by 2048 latents", NETWORK),
            (2, 0, "left stream", "6 blocks, 1024 latents", LEFT),
            (2, 2, "right stream", "6 blocks, 1024 latents", RIGHT),
            (3, 1, "one block over both", "2048 latents", BOTH),
            (3, 0, "left keypose", ANSWER, LEFT),
            (3, 2, "right keypose", ANSWER, RIGHT),
        ],
        [(0, 3), (3, 4), (1, 4), (2, 4), (4, 5), (4, 6), (5, 7), (6, 7), (7, 8), (7, 9)],
    ),
    "peract_lf": (
        "PerAct-LF: a leader, and a follower that is told the leader's keypose",
        [
            *EYES,
            (1, 1, "voxel grid, words", "100 x 100 x 100, 10 channels", NETWORK),
            (2, 0, "leader: a PerAct", "the right arm, or the left", RIGHT),
            (2, 2, "follower: a PerAct", "and 8 numbers of the leader", LEFT),
            (3, 0, "leader's keypose", ANSWER, RIGHT),
            (3, 2, "follower's keypose", ANSWER, LEFT),
        ],
        [(0, 3), (1, 3), (2, 3), (3, 4), (3, 5), (4, 6), (6, 5), (5, 7)],
    ),
    "peract_independent": (
        "Independent PerAct: two networks that know nothing of each other",
        [
            *EYES,
            (1, 1, "voxel grid, words", "100 x 100 x 100, 10 channels", NETWORK),
            (2, 0, "left: a PerAct", "its own arm's 4 numbers", LEFT),
            (2, 2, "right: a PerAct", "its own arm's 4 numbers", RIGHT),
            (3, 0, "left keypose", ANSWER, LEFT),
            (3, 2, "right keypose", ANSWER, RIGHT),
        ],
        [(0, 3), (1, 3), (2, 3), (3, 4), (3, 5), (4, 6), (5, 7)],
    ),
    "rvt_lf": (
        "RVT-LF: leader and follower that look at five drawn views instead of voxels",
        [
            *EYES,
            (1, 1, "five drawn views, words", "5 x 220 x 220, 10 channels", NETWORK),
            (2, 0, "leader: an RVT", "each view, then all and words", RIGHT),
            (2, 2, "follower: an RVT", "and 8 numbers of the leader", LEFT),
            (3, 0, "leader's keypose", "where five heatmaps agree", RIGHT),
            (3, 2, "follower's keypose", "where five heatmaps agree", LEFT),
        ],
        [(0, 3), (1, 3), (2, 3), (3, 4), (3, 5), (4, 6), (6, 5), (5, 7)],
    ),
}


def draw(policy: str) -> str:
    """The drawing of a policy."""
    title, blocks, arrows = FIGURES[policy]
    corners = [(10 + column * (WIDTH + GAP_X), 50 + row * (HEIGHT + GAP_Y)) for column, row, *_ in blocks]
    parts = [text((10, 30), title, "title")]
    for start, end in arrows:
        (left, top), (to_left, to_top) = corners[start], corners[end]
        if to_left == left:
            down = to_top > top
            middle = left + WIDTH / 2
            parts.append(
                arrow(
                    (middle, top + HEIGHT * down),
                    (middle, to_top - 2 if down else to_top + HEIGHT + 2),
                    LINES,
                    1.5,
                )
            )
        elif to_left > left:
            parts.append(
                arrow((left + WIDTH, top + HEIGHT / 2), (to_left - 2, to_top + HEIGHT / 2), LINES, 1.5)
            )
        else:  # back from the leader's answer to the follower
            parts.append(arrow((left + 40, top + HEIGHT), (to_left + WIDTH - 30, to_top - 2), LINES, 1.5))
    for (_, _, first, second, color), (left, top) in zip(blocks, corners, strict=True):
        parts.append(box(left, top, WIDTH, HEIGHT, color))
        parts.append(text((left + WIDTH / 2, top + 27), first, anchor="middle"))
        parts.append(text((left + WIDTH / 2, top + 47), second, "small", anchor="middle"))
    width = max(left for left, _ in corners) + WIDTH + 10
    height = max(top for _, top in corners) + HEIGHT + 24
    return svg(width, round(height), parts, title)


if __name__ == "__main__":
    for policy in FIGURES:
        (DOCS / f"{policy}.svg").write_text(draw(policy), encoding="utf-8")
