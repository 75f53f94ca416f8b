"""Validated JSON records: frozen pydantic models that are read from and written to one file each."""

import json
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from lerobot_bimanual.errors import BimanualError, plain, shown
from lerobot_bimanual.files import read_file, write_file

Name = Annotated[str, Field(pattern=r"^\w[\w.-]*$", max_length=100)]
Text = Annotated[str, Field(pattern=r"^[^\x00-\x1f\x7f-\x9f]*$", max_length=200)]
"""What people are shown: one line."""


class BadRecord(BimanualError):
    """A file that does not hold the expected record; the message names the file and the field."""


class Record(BaseModel):
    """A frozen record whose every field is as declared: none missing, unknown, converted or not finite.

    Rules between fields are pydantic validators; they use `require`. `read`, `from_json` and `of` refuse an invalid
    record by a `BadRecord`, which names the field.
    """

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)

    @classmethod
    def read(cls, path: Path) -> Self:
        """The record in a JSON file, which a `BadRecord` names, too."""
        try:
            return cls.from_json(read_file(path))
        except BimanualError as error:
            raise BadRecord(f"{path}: {error}") from None

    @classmethod
    def from_json(cls, text: str | bytes) -> Self:
        """The record in a JSON text."""
        try:
            return cls.model_validate_json(text)
        except ValidationError as error:
            raise BadRecord(_sentence(error, cls.__name__)) from None

    @classmethod
    def of(cls, **fields: Any) -> Self:
        """The record of these fields."""
        try:
            return cls(**fields)
        except ValidationError as error:
            raise BadRecord(_sentence(error, cls.__name__)) from None

    def write(self, path: Path) -> None:
        """Write the record as JSON, atomically; items of its lists have one line each.

        Raises:
            UnwritableOutput: the file cannot be written.
        """
        write_file(path, self.to_json())

    def to_json(self) -> str:
        """The record as JSON; items of its lists have one line each. Fields that have their defaults are left out."""
        fields = self.model_dump(mode="json", exclude_defaults=True)
        return "{\n" + ",\n".join(f" {json.dumps(name)}: {_lines(fields[name])}" for name in fields) + "\n}\n"


def result_paths(place: Path) -> list[Path]:
    """The file itself, or the JSON files of a folder but LeRobot's own, sorted; one without any is a `BadRecord`."""
    found = sorted({*place.glob("*.json")} - {place / "eval_info.json"}) if place.is_dir() else [place]
    if not found:
        raise BadRecord(
            f"{place} holds no results; `lerobot-bimanual policy benchmark` writes them to OUTPUT/results"
        )
    return found


def require(holds: object, rule: str) -> None:
    """Refuse a record that breaks a rule between its fields, by a ValueError, which pydantic reports."""
    if not holds:
        raise ValueError(rule)


def _sentence(error: ValidationError, name: str) -> str:
    """First problem of a validation, with its field and value, and the number of further problems."""
    # Where a default depends on a field that is wrong, pydantic reports it as well.
    problems = [
        each for each in error.errors(include_url=False) if each["type"] != "default_factory_not_called"
    ]
    first, more = problems[0], len(problems) - 1
    place = plain(".".join(map(str, first["loc"])) or name)
    got = shown(first["input"])
    problem = first["msg"].removeprefix("Value error, ")
    if first["type"] == "json_invalid":
        return f"should hold a record in JSON: {problem}"
    if first["type"] == "missing":
        problem = "is missing"
    elif first["loc"]:  # of a whole record the value says too much
        problem = f"{problem}, but is {got}"
    others = f" (and {more} more)" if more else ""
    return f"{place}: {problem}{others}"


def _lines(value: Any) -> str:
    if isinstance(value, list) and any(isinstance(item, dict) for item in value):
        return "[\n" + ",\n".join(f"  {json.dumps(item, ensure_ascii=False)}" for item in value) + "\n ]"
    return json.dumps(value, ensure_ascii=False)
