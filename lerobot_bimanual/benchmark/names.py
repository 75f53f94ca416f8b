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


def dataset_name(task: str, variation: str, trained_on: str) -> str:
    """What the folder of the demonstrations of a task, or of several, is called.

    Args:
        task: the one that is scored.
        variation: of it.
        trained_on: several tasks and suites, separated by commas; empty for the task alone.
    """
    return trained_on.replace(",", ".") if trained_on else place_name(task, variation)


def learner_name(name: str, trained_on: str) -> str:
    """A policy's or training's name, with the tasks that it learned from if there are several."""
    return f"{name}_on_{trained_on.replace(',', '.')}" if trained_on else name
