"""The campaign on disk: campaign.toml, machine.toml and the records, in the formats that a laboratory would use."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyuff
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter
from numpy.typing import NDArray
from scipy.io import savemat

from cutvib_ss.blind.rig.blows import BLOCK, FS
from cutvib_ss.blind.rig.campaign import Campaign, Frf
from cutvib_ss.blind.rig.conditions import Nominal
from cutvib_ss.blind.rig.motion import CHANNELS
from cutvib_ss.blind.rig.structure import TOLERANCE

Array = NDArray[np.float64]

_G = 9.80665
_SUFFIX = {"tdms": "tdms", "csv": "csv", "mat": "mat", "uff": "uff", "csv_frf": "csv", "mat_frf": "mat"}
_DOFS = {"tool_x": (1, 1), "tool_z": (1, 3), "base_x": (2, 1)}


def write(campaign: Campaign, nominal: Nominal, folder: Path) -> None:
    """
    Write the whole campaign; campaign.toml comes last, so that a folder with one is complete.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    nominal : Nominal
        The nominal machine.
    folder : Path
        Where to; made if absent.
    """
    records = folder / "records"
    records.mkdir(parents=True, exist_ok=True)
    c = campaign.conditions
    tables = []
    levels = len(c.levels)
    for i, (position, level) in enumerate(campaign.records):
        name = f"p{i // levels + 1}_l{i % levels + 1}.{_SUFFIX[c.file_format]}"
        averages = write_record(campaign, i, records / name)
        lines = [f'file = "records/{name}"', f'kind = "{"frf" if c.frf else "impact"}"']
        lines += [f"position = {position!r}", f"peak_force = {level!r}"]
        lines += [f"averages = {averages}"] if c.frf else []
        tables.append("\n".join(["[[record]]", *lines]))
    drift = c.repeatability.stated
    (folder / "machine.toml").write_text(machine_toml(nominal, drift), encoding="utf-8")
    head = '[campaign]\ntitle = "measurement campaign"\nmachine = "machine.toml"\n'
    (folder / "campaign.toml").write_text("\n\n".join([head.rstrip(), *tables]) + "\n", encoding="utf-8")


def machine_toml(nominal: Nominal, drift: float | None = None) -> str:
    """
    The nominal machine, as its builder would write it down.

    Parameters
    ----------
    nominal : Nominal
        The nominal machine.
    drift : float, optional
        How far it is stated to move between sessions.

    Returns
    -------
    str
        Text of machine.toml.
    """
    rail = {key: value for key, value in vars(nominal.rail).items() if key != "truncation"} | {
        "n_modes": nominal.n_modes
    }
    tables = {
        "head": vars(nominal.head),
        "rail": rail,
        "tolerance": dict(TOLERANCE) | ({} if drift is None else {"drift": drift}),
    }
    return "\n\n".join(
        "\n".join([f"[{name}]", *(f"{key} = {value!r}" for key, value in table.items())])
        for name, table in tables.items()
    ) + "\n"  # fmt: skip


def write_record(campaign: Campaign, record: int, path: Path) -> int:
    """
    Write one record.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    record : int
        Which record.
    path : Path
        File to write.

    Returns
    -------
    int
        Number of blows in it.
    """
    c = campaign.conditions
    if c.frf:
        frf = campaign.frf(record)
        {"uff": _uff, "csv_frf": _csv_frf, "mat_frf": _mat_frf}[c.file_format](path, frf, c.channels, c.unit)
        return frf.averages
    blows = []
    for b in range(c.blows):
        force, responses = campaign.recording(record, b)
        shown = {name: responses[CHANNELS.index(name)] / (_G if c.unit == "g" else 1.0) for name in c.channels}
        blows.append({"force": force} | shown)
    {"tdms": _tdms, "csv": _csv, "mat": _mat}[c.file_format](path, blows, c.unit)
    return c.blows


def _units(names: Sequence[str], unit: str) -> dict[str, str]:
    return {name: "N" if name == "force" else unit for name in names}


def _tdms(path: Path, blows: list[dict[str, Array]], unit: str) -> None:
    objects: list[Any] = [RootObject()]
    for k, blow in enumerate(blows, start=1):
        objects.append(GroupObject(f"blow_{k}"))
        for name, values in blow.items():
            properties = {"unit_string": _units([name], unit)[name], "wf_increment": 1 / FS, "wf_start_offset": 0.0}
            objects.append(ChannelObject(f"blow_{k}", name, values.astype(np.float32), properties=properties))
    with TdmsWriter(str(path)) as writer:
        writer.write_segment(objects)


def _csv(path: Path, blows: list[dict[str, Array]], unit: str) -> None:
    time = np.arange(round(BLOCK * FS)) / FS
    header = ["blow", "time [s]", *(f"{name} [{u}]" for name, u in _units(list(blows[0]), unit).items())]
    rows = [np.column_stack([np.full(time.size, k), time, *b.values()]) for k, b in enumerate(blows, start=1)]
    formats = ["%d", "%.5f", *["%.7g"] * len(blows[0])]
    np.savetxt(path, np.vstack(rows), fmt=formats, delimiter=",", header=",".join(header), comments="")


def _mat(path: Path, blows: list[dict[str, Array]], unit: str) -> None:
    channels = {name: np.column_stack([b[name] for b in blows]).astype(np.float32) for name in blows[0]}
    _save(path, channels | {"fs": FS, "units": _units(list(channels), unit)})


def _save(path: Path, variables: dict[str, Any]) -> None:
    """A MATLAB file whose header bears no date: the same case gives the same bytes."""
    savemat(path, variables)
    with path.open("r+b") as file:
        file.write(b"MATLAB 5.0 MAT-file".ljust(116))


def _shown(frf: Frf, channels: Sequence[str], unit: str) -> dict[str, tuple[NDArray[np.complex128], Array]]:
    scale = _G if unit == "g" else 1.0
    return {n: (frf.data[CHANNELS.index(n)] / scale, frf.coherence[CHANNELS.index(n)]) for n in channels}


def _csv_frf(path: Path, frf: Frf, channels: Sequence[str], unit: str) -> None:
    header, columns = ["freq [Hz]"], [frf.freq]
    for name, (data, coherence) in _shown(frf, channels, unit).items():
        header += [f"{name} re [{unit}/N]", f"{name} im [{unit}/N]", f"{name} coherence"]
        columns += [data.real, data.imag, coherence]
    np.savetxt(path, np.column_stack(columns), fmt="%.9g", delimiter=",", header=",".join(header), comments="")


def _mat_frf(path: Path, frf: Frf, channels: Sequence[str], unit: str) -> None:
    variables: dict[str, Any] = {"freq": frf.freq, "units": dict.fromkeys(channels, f"{unit}/N")}
    for name, (data, coherence) in _shown(frf, channels, unit).items():
        variables |= {name: data, f"{name}_coherence": coherence}
    _save(path, variables)


def _uff(path: Path, frf: Frf, channels: Sequence[str], unit: str) -> None:
    sets = []
    for name, (data, coherence) in _shown(frf, channels, "m/s^2").items():
        node, direction = _DOFS[name]
        for function, ordinate, values in ((4, 12, data), (6, 1, coherence)):
            header: dict[str, Any] = {"type": 58, "binary": 0, "func_type": function, "func_id": 0, "ver_num": 1}
            header |= {"load_case_id": 0, "rsp_ent_name": "NONE", "ref_ent_name": "NONE", "z_axis_value": 0.0}
            header |= {"rsp_node": node, "rsp_dir": direction, "ref_node": 1, "ref_dir": 1}
            header |= {f"id{k}": "NONE" for k in range(1, 6)}
            for axis in ("abscissa", "ordinate", "orddenom", "z_axis"):
                header |= {f"{axis}_{part}_unit_exp": 0 for part in ("len", "force", "temp")}
                header |= {f"{axis}_axis_lab": "NONE", f"{axis}_axis_units_lab": "NONE", f"{axis}_spec_data_type": 0}
            header |= {"abscissa_spec_data_type": 18, "ordinate_spec_data_type": ordinate}
            header |= {"orddenom_spec_data_type": 13 if function == 4 else 0}
            header |= {"abscissa_spacing": 1, "abscissa_min": 0.0, "abscissa_inc": 1 / BLOCK}
            sets.append(header | {"x": frf.freq, "data": values})
    pyuff.UFF(str(path)).write_sets(sets, mode="overwrite")
