"""campaign.toml: its keys and their checks."""

from __future__ import annotations

import codecs
import json
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AliasChoices, BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from cutvib_ss.errors import DataFormatError
from cutvib_ss.files import read_toml

_Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
_Count = Annotated[int, Field(ge=1)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class CampaignTable(_Table):
    """The ``[campaign]`` table."""

    title: str = ""
    machine: str | None = None


class ChannelTable(_Table):
    """Where one channel is in a file, and what its numbers mean: physical = sign · gain · e^(iφ) · value in `unit`."""

    name: Annotated[str, Field(min_length=1)] | Annotated[int, Field(ge=1)] | None = None
    unit: Annotated[str, Field(min_length=1)] | None = None
    gain: _Positive | None = None
    sign: Literal[1, -1] | None = None
    phase_deg: Annotated[float, Field(ge=-360, le=360, allow_inf_nan=False)] | None = None


class CsvTable(_Table):
    """What of a CSV file cannot be told from the file itself."""

    delimiter: Annotated[str, Field(min_length=1, max_length=1)] | None = None
    decimal: Literal[".", ","] | None = None
    encoding: Annotated[str, Field(min_length=1)] | None = None
    header_lines: Annotated[int, Field(ge=0)] | None = None
    time: Annotated[str, Field(min_length=1)] | Annotated[int, Field(ge=1)] | None = Field(
        default=None, validation_alias=AliasChoices("time", "time_column")
    )

    @field_validator("encoding")
    @classmethod
    def _known_encoding(cls, value: str | None) -> str | None:
        if value is not None:
            try:
                codecs.lookup(value)
            except LookupError:
                raise ValueError("no encoding of that name; utf-8, cp1252, latin-1 and utf-16 are usual") from None
        return value


_Channels = dict[str, ChannelTable]


def _short_channels(value: Any) -> Any:
    """``tool_x = "Acc 1"`` and ``tool_x = 2`` are short for ``tool_x = { name = … }``."""
    if not isinstance(value, dict):
        return value
    return {k: {"name": v} if isinstance(v, (str, int)) and not isinstance(v, bool) else v for k, v in value.items()}


class RecordTable(_Table):
    """A ``[[record]]`` table: one position and level, its files, and how they were measured."""

    file: str | list[str]
    kind: Literal["impact", "frf", "timeseries"]
    use: Literal["fit", "check"] | None = None
    position: Annotated[float, Field(gt=0, lt=1, allow_inf_nan=False)] | None = None
    peak_force: _Positive | None = None
    averages: _Count = 1
    excitation: Literal["impact", "random", "multisine", "sine"] | None = None
    block: _Positive | None = None
    blow_at: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None
    exponential_decay: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.0
    session: str | None = None
    band_hz: tuple[_Positive, _Positive] | None = Field(default=None, strict=False)
    input: Annotated[str, Field(min_length=1)] | None = None
    sweep: Literal["up", "down", "random"] | None = None
    controlled: Literal["force", "response"] | None = None
    peak_response: _Positive | None = None
    channels: _Channels = {}
    csv: CsvTable | None = None

    _short = field_validator("channels", mode="before")(_short_channels)

    @field_validator("file")
    @classmethod
    def _some_file(cls, value: str | list[str]) -> str | list[str]:
        if not value or (isinstance(value, list) and not all(value)):
            raise ValueError("name at least one file")
        if isinstance(value, list) and len(set(value)) < len(value):
            raise ValueError("a file is named twice; name each blow once")
        return value

    @field_validator("band_hz")
    @classmethod
    def _ascending(cls, value: tuple[float, float] | None) -> tuple[float, float] | None:
        if value is not None and not value[0] < value[1]:
            raise ValueError("give the lower end first")
        return value

    @model_validator(mode="after")
    def _of_one_piece(self) -> RecordTable:
        stated = [key for key in ("sweep", "controlled", "peak_response") if getattr(self, key) is not None]
        if stated and (self.kind == "impact" or self.excitation != "sine"):
            raise ValueError(f'{stated[0]} is of a sine record; add excitation = "sine" (kind = "frf"), or remove it')
        if self.peak_response is not None and self.controlled != "response":
            raise ValueError('peak_response needs controlled = "response"')
        return self

    @property
    def files(self) -> tuple[str, ...]:
        """The files, in order."""
        return (self.file,) if isinstance(self.file, str) else tuple(self.file)


class CampaignFile(_Table):
    """The whole of campaign.toml."""

    campaign: CampaignTable = CampaignTable()
    record: Annotated[list[RecordTable], Field(min_length=1)]
    dofs: dict[str, Annotated[int, Field(ge=0)]] = {}
    channels: _Channels = {}
    csv: CsvTable = CsvTable()

    _short = field_validator("channels", mode="before")(_short_channels)

    def channels_of(self, record: RecordTable) -> dict[str, ChannelTable]:
        """Mapping of a record's channels: the campaign's, each key overridden by the record's own."""
        merged = dict(self.channels)
        for name, own in record.channels.items():
            common = merged.get(name, ChannelTable())
            merged[name] = common.model_copy(update=own.model_dump(exclude_unset=True))
        return merged

    def csv_of(self, record: RecordTable) -> CsvTable:
        """How a record's CSV files are written: the campaign's statements, each overridden by the record's own."""
        return self.csv if record.csv is None else self.csv.model_copy(update=record.csv.model_dump(exclude_unset=True))


def read_campaign_file(path: Path) -> CampaignFile:
    """Parse and check a campaign.toml."""
    content = read_toml(path, "a campaign is a folder with a campaign.toml")
    if not content.get("record"):
        raise DataFormatError(f"{path}: the campaign has no [[record]]; add one for each position and level")
    try:
        return CampaignFile.model_validate(content)
    except ValidationError as error:
        # an unknown key first: misspelt, it is what makes another one missing
        first = min(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
        more = f" (and {error.error_count() - 1} more)" if error.error_count() > 1 else ""
        raise DataFormatError(f"{path}: {_say(first)}{more}") from None


def _say(error: Any) -> str:
    where = ""
    for part in error["loc"]:
        if isinstance(part, int):
            where += f"[{part + 1}]"
        elif not (part in ("str", "list[str]") or "[" in str(part)):  # pydantic's names of the members of a union
            where += f".{part}" if where else str(part)
    kind, value = error["type"], error.get("input")
    if kind == "extra_forbidden":
        return f"{where}: unknown key; remove it or correct its spelling"
    if kind == "missing":
        return f"{where}: missing; add it"
    if isinstance(value, dict):  # a check of a whole table: its message names the key
        return f"{where}: {error['msg'].removeprefix('Value error, ')}"
    hint = "; y_b / L lies strictly inside (0, 1)" if error["loc"][-1] == "position" else ""
    said = error["msg"].removeprefix("Value error, ")
    return f"{where} = {value!r}: {said[0].lower()}{said[1:]}{hint}"


def toml_text(value: str | float | tuple[float, ...]) -> str:
    """A TOML value: JSON's strings and numbers are TOML's as well, but for DEL."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
