"""What the folders, lines and files of a benchmark are called."""


def perturbed(name: str, perturb: str) -> str:
    """A name of something in a perturbed world.

    Args:
        name: in the world as it is.
        perturb: `AXIS:LEVEL,...`; empty for the world as it is.
    """
    return f"{name}_{perturb.replace(':', '')}" if perturb else name


def place_name(task: str, variation: str) -> str:
    """What the folder and the line of a task, or of one of its variations, are called."""
    return task if variation == "any" else f"{task}_{variation}"


def run_name(policy: str, recipe: str, seed: int) -> str:
    """What the folder of a training is called."""
    return f"{policy}_{recipe}_seed{seed}"


def result_name(place: str, run: str) -> str:
    """What the file of a row is called."""
    return f"{place}_{run}.json"
