"""The campaign on disk: campaign.toml, machine.toml and the records, in the formats that a laboratory would use."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyuff
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter
from numpy.typing import NDArray
from scipy.io import savemat

from cutvib_ss.validation.rig.blows import BLOCK, FS
from cutvib_ss.validation.rig.campaign import Campaign, Frf
from cutvib_ss.validation.rig.conditions import Nominal
from cutvib_ss.validation.rig.frames import FrameNominal

Array = NDArray[np.float64]

_G = 9.80665
_SUFFIX = {"tdms": "tdms", "csv": "csv", "mat": "mat", "uff": "uff", "csv_frf": "csv", "mat_frf": "mat"}
_DOFS = {"tool_x": (1, 1), "tool_z": (1, 3), "base_x": (2, 1)}


def write(campaign: Campaign, nominal: Nominal | FrameNominal, folder: Path) -> None:
    """Write the whole campaign; campaign.toml comes last, so that a folder with one is complete."""
    records = folder / "records"
    records.mkdir(parents=True, exist_ok=True)
    c = campaign.conditions
    tables = []
    levels = len(c.levels)
    for i, (position, level) in enumerate(campaign.records):
        name = f"p{i // levels + 1}_l{i % levels + 1}.{_SUFFIX[c.file_format]}"
        averages = write_record(campaign, i, records / name)
        lines = [f'file = "records/{name}"', f'kind = "{"frf" if c.frf else "impact"}"']
        lines += [f"position = {position!r}"] if position is not None else [f'session = "{i // levels + 1}"']
        days = c.repeatability.days
        lines += [f'session = "day {i // levels * days // len(c.positions) + 1}"'] if days else []
        lines += [f"peak_force = {level!r}"]
        lines += [f"averages = {averages}"] if c.frf else []
        tables.append("\n".join(["[[record]]", *lines]))
    drift = c.repeatability.stated
    (folder / "machine.toml").write_text(nominal.toml(drift), encoding="utf-8")
    head = '[campaign]\ntitle = "measurement campaign"\nmachine = "machine.toml"\n'
    (folder / "campaign.toml").write_text("\n\n".join([head.rstrip(), *tables]) + "\n", encoding="utf-8")


def write_record(campaign: Campaign, record: int, path: Path) -> int:
    """Write one record."""
    c = campaign.conditions
    if c.frf:
        frf = campaign.frf(record)
        responses_of = _shown(frf, campaign, c.unit)
        {"uff": _uff, "csv_frf": _csv_frf, "mat_frf": _mat_frf}[c.file_format](path, frf, responses_of)
        return frf.averages
    blows = []
    for b in range(c.blows):
        force, responses = campaign.recording(record, b)
        units = _units(campaign, c.unit)
        shown = {n: responses[campaign.names.index(n)] / (_G if units[n] == "g" else 1.0) for n in c.channels}
        blows.append({"force": force} | shown)
    {"tdms": _tdms, "csv": _csv, "mat": _mat}[c.file_format](path, blows, _units(campaign, c.unit))
    return c.blows


def _units(campaign: Campaign, acceleration: str) -> dict[str, str]:
    """Units of force and responses by channel."""
    units = ("m", "m/s", acceleration)
    return {"force": "N"} | {c.name: units[c.order] for c in campaign.rig.channels}


def _tdms(path: Path, blows: list[dict[str, Array]], units: dict[str, str]) -> None:
    objects: list[Any] = [RootObject()]
    for k, blow in enumerate(blows, start=1):
        objects.append(GroupObject(f"blow_{k}"))
        for name, values in blow.items():
            properties = {"unit_string": units[name], "wf_increment": 1 / FS, "wf_start_offset": 0.0}
            objects.append(ChannelObject(f"blow_{k}", name, values.astype(np.float32), properties=properties))
    with TdmsWriter(str(path)) as writer:
        writer.write_segment(objects)


def _csv(path: Path, blows: list[dict[str, Array]], units: dict[str, str]) -> None:
    time = np.arange(round(BLOCK * FS)) / FS
    header = ["blow", "time [s]", *(f"{name} [{units[name]}]" for name in blows[0])]
    rows = [np.column_stack([np.full(time.size, k), time, *b.values()]) for k, b in enumerate(blows, start=1)]
    formats = ["%d", "%.5f", *["%.7g"] * len(blows[0])]
    np.savetxt(path, np.vstack(rows), fmt=formats, delimiter=",", header=",".join(header), comments="")


def _mat(path: Path, blows: list[dict[str, Array]], units: dict[str, str]) -> None:
    channels = {name: np.column_stack([b[name] for b in blows]).astype(np.float32) for name in blows[0]}
    _save(path, channels | {"fs": FS, "units": {name: units[name] for name in channels}})


def _save(path: Path, variables: dict[str, Any]) -> None:
    """A MATLAB file whose header bears no date: the same case gives the same bytes."""
    savemat(path, variables)
    with path.open("r+b") as file:
        file.write(b"MATLAB 5.0 MAT-file".ljust(116))


def _shown(frf: Frf, campaign: Campaign, unit: str) -> dict[str, tuple[str, NDArray[np.complex128], Array]]:
    """Unit over newton, response and coherence of each channel that is recorded."""
    out, units = {}, _units(campaign, "m/s^2" if campaign.conditions.file_format == "uff" else unit)
    for name in campaign.conditions.channels:
        i = campaign.names.index(name)
        out[name] = (f"{units[name]}/N", frf.data[i] / (_G if units[name] == "g" else 1.0), frf.coherence[i])
    return out


def _csv_frf(path: Path, frf: Frf, shown: dict[str, tuple[str, NDArray[np.complex128], Array]]) -> None:
    header, columns = ["freq [Hz]"], [frf.freq]
    for name, (unit, data, coherence) in shown.items():
        header += [f"{name} re [{unit}]", f"{name} im [{unit}]", f"{name} coherence"]
        columns += [data.real, data.imag, coherence]
    np.savetxt(path, np.column_stack(columns), fmt="%.9g", delimiter=",", header=",".join(header), comments="")


def _mat_frf(path: Path, frf: Frf, shown: dict[str, tuple[str, NDArray[np.complex128], Array]]) -> None:
    variables: dict[str, Any] = {"freq": frf.freq, "units": {name: unit for name, (unit, _, _) in shown.items()}}
    for name, (_, data, coherence) in shown.items():
        variables |= {name: data, f"{name}_coherence": coherence}
    _save(path, variables)


def _uff(path: Path, frf: Frf, shown: dict[str, tuple[str, NDArray[np.complex128], Array]]) -> None:
    sets = []
    for name, (_, data, coherence) in shown.items():
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
