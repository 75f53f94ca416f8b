"""Draw every task half-way through its expert's episode into one picture.

python examples/05_draw_all_tasks.py --output=docs/tasks.jpg
"""

import argparse
from pathlib import Path

from PIL import Image, ImageDraw

from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.expert.runner import run_expert
from lerobot_env_bimanual.registry import get_task, list_tasks

WIDTH, HEIGHT, COLUMNS = 400, 300, 5
MOMENT = 0.6
"""Share of the episode that has passed in the picture."""


def picture(task: str, seed: int) -> Image.Image:
    """The front view at that moment, with the task's name."""
    env = BimanualEnv(task, obs="state", split="val", render_quality="high")
    ticks = run_expert(env, seed).ticks
    frames = []

    def keep(env: BimanualEnv, joint_action) -> None:
        if env.progress.ticks == int(MOMENT * ticks):
            frames.append(env.render())

    env.tick_listener = keep
    run_expert(env, seed)
    env.close()
    image = Image.fromarray(frames[0]).resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)
    ImageDraw.Draw(image).text((8, 6), task, fill=(30, 30, 40), font_size=20)
    return image


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--output", type=Path, default=Path("outputs/tasks.jpg"))
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    names = sorted(list_tasks(), key=lambda name: get_task(name).spec.id)
    rows = -(-len(names) // COLUMNS)
    sheet = Image.new("RGB", (COLUMNS * WIDTH, rows * HEIGHT), "white")
    for index, name in enumerate(names):
        sheet.paste(picture(name, arguments.seed), (index % COLUMNS * WIDTH, index // COLUMNS * HEIGHT))
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    sheet.save(arguments.output, quality=85)
    print(arguments.output)
