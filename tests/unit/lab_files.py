"""Small files in the layouts that measuring systems write, all of the same three blows on the published machine."""

import nptdms
import numpy as np
import pyuff
from scipy import signal
from scipy.io import savemat

from cutvib_ss.model.machine import published_machine
from cutvib_ss.response.frequency import frequency_response

FS = 2048.0
SAMPLES = 2048
G = 9.80665
PEAKS = (40.0, 60.0, 80.0)
CHANNELS = ("tool_x", "tool_z", "base_x")


def blows(position=0.4, peaks=PEAKS, noise=0.0, seed=0, samples=SAMPLES):
    """Force [N] and accelerations [m/s^2] of some blows, shape (blow, 4, sample), through the model's own response."""
    rng = np.random.default_rng(seed)
    # ten times as long, so that what has not died out does not wrap round
    size = 10 * samples
    freq = np.fft.rfftfreq(size, 1 / FS)
    h = np.zeros((3, freq.size), complex)
    h[:, 1:] = frequency_response(published_machine(), [position], freq[1:], outputs=CHANNELS).data[0, :, 0]
    table = []
    # pulses of one shape: what the record cuts off of the response is then no scatter from blow to blow
    pulse = signal.windows.hann(9)
    for peak in peaks:
        force = np.zeros(size)
        force[200 : 200 + pulse.size] = peak * pulse
        motion = np.fft.irfft(np.fft.rfft(force) * h, size)
        rows = np.vstack([force, motion])[:, :samples]
        table.append(rows + noise * rng.standard_normal(rows.shape))
    return np.array(table)


def time_axis(samples=SAMPLES):
    return np.arange(samples) / FS


def german_csv(path, table, encoding="cp1252"):
    """Separator ;, decimal comma, a head, units in a line of their own with a superscript, as DIAdem and Excel write."""
    lines = ["Prüfstand: Portal 3", "Prüfer;Müller", "Datum;12.03.2024", "", "Zeit;Hammer;Beschl 1;Beschl 2;Beschl 3"]
    lines.append("s;N;m/s²;m/s²;m/s²")
    for t, row in zip(time_axis(), table.T, strict=True):
        lines.append(";".join(f"{x:.9g}".replace(".", ",") for x in (t, *row)))
    path.write_bytes(("\r\n".join(lines) + "\r\n").encode(encoding))


def dewesoft_csv(path, table):
    """Tab-separated text with a head, headings with units in parentheses; accelerations in g."""
    lines = [
        "Data File Info",
        "File name:\tTest_0001.dxd",
        "Start time:\t3/12/2024 10:14:05.123",
        "Sample rate:\t2048 Hz",
        "",
    ]
    lines += ["Data1", "Time (s)\tAI 1/Hammer (N)\tAI 2/Acc tool X (g)\tAI 3/Acc tool Z (g)\tAI 4/Acc base X (g)"]
    scale = np.array([1, G, G, G])
    for t, row in zip(time_axis(), table.T / scale, strict=True):
        lines.append("\t".join(f"{x:.10g}" for x in (t, *row)))
    path.write_text("\n".join(lines) + "\n")


def dewesoft_mat(path, table, days=False):
    """A variable a channel, and the time of each: seconds from the start, or the date in days."""
    time = time_axis() if not days else 738957.4236 + time_axis() / 86400
    names = ("AI_1_Hammer", "AI_2_Acc_X", "AI_3_Acc_Z", "AI_4_Acc_base")
    variables = {}
    for name, row in zip(names, table, strict=True):
        variables[f"Data1_{name}"] = row[:, np.newaxis]
        variables[f"Data1_time_{name}"] = time[:, np.newaxis]
    savemat(path, variables)


def testlab_mat(path, table):
    """Structs of one quantity each, with x_values, y_values and function_record."""

    def struct(rows, names, label):
        return {
            "x_values": {
                "start_value": 0.0, "increment": 1 / FS, "number_of_values": float(rows.shape[1]),
                "quantity": {"label": "s"},
            },
            "y_values": {"values": rows.T, "quantity": {"label": label}},
            "function_record": {"name": np.array(names, dtype=object), "type": "Time"},
        }  # fmt: skip

    savemat(
        path,
        {
            "Signal_0": struct(table[:1], ["Hammer:+X"], "N"),
            "Signal_1": struct(table[1:] / G, ["Tool:+X", "Tool:+Z", "Base:+X"], "g"),
        },
    )


def testlab_frf_mat(path, freq, data):
    """FRFs as Testlab exports them: a complex matrix, its start and increment."""
    savemat(
        path,
        {
            "FRF": {
                "x_values": {
                    "start_value": freq[0], "increment": freq[1] - freq[0], "number_of_values": float(freq.size),
                    "quantity": {"label": "Hz"},
                },
                "y_values": {"values": data.T, "quantity": {"label": "m/s^2/N"}},
                "function_record": {"name": np.array(["Tool:+X", "Tool:+Z", "Base:+X"], dtype=object)},
            }
        },
    )  # fmt: skip


def bk_mat(path, table):
    """Channel_n_Data beside Channel_n_Header, and File_Header."""
    names, units = ("Hammer", "Tool X", "Tool Z", "Base X"), ("N", "m/s²", "m/s²", "m/s²")
    variables = {"File_Header": {"SampleFrequency": str(FS), "NumberOfChannels": "4"}}
    for k, (name, unit, row) in enumerate(zip(names, units, table, strict=True), start=1):
        variables[f"Channel_{k}_Header"] = {"SignalName": name, "Unit": unit, "NoOfSamples": str(row.size)}
        variables[f"Channel_{k}_Data"] = row[:, np.newaxis]
    savemat(path, variables)


def struct_mat(path, tables):
    """A struct of values and unit a channel, samples in rows and blows in columns, and Fs."""
    names, units, scale = ("Hammer", "a_x", "a_z", "a_b"), ("N", "g", "g", "g"), (1, G, G, G)
    variables = {name: {"values": tables[:, k].T / scale[k], "unit": units[k]} for k, name in enumerate(names)}
    savemat(path, {"Fs": FS, **variables, "comment": "row B"})


def tdms_by_sensor(path, table):
    """One group a module, as FlexLogger writes: channels of other groups at another rate beside them."""
    properties = {"wf_increment": 1 / FS}
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(
            [
                nptdms.ChannelObject("Mod1", "Impact Hammer", table[0], properties={**properties, "unit_string": "N"}),
                *(
                    nptdms.ChannelObject(
                        "Mod2", f"Acc {k}", table[k] / G, properties={**properties, "unit_string": "g"}
                    )
                    for k in (1, 2, 3)
                ),
                nptdms.ChannelObject("Slow", "Temperature", np.full(20, 21.5), properties={"wf_increment": 0.1}),
            ]
        )


def tdms_by_blow(path, tables):
    """A group a blow, channels under the recorder's names."""
    with nptdms.TdmsWriter(path) as writer:
        for k, table in enumerate(tables):
            writer.write_segment(
                [
                    nptdms.ChannelObject(
                        f"Hit {k + 1}", name, row, properties={"wf_increment": 1 / FS, "unit_string": unit}
                    )
                    for name, row, unit in zip(
                        ("Force", "Acc1", "Acc2", "Acc3"), table, ("N", "m/s^2", "m/s^2", "m/s^2"), strict=True
                    )
                ]
            )


_LVM_HEAD = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t,\n"
    "Multi_Headings\tYes\nX_Columns\tOne\nTime_Pref\tRelative\n***End_of_Header***\t\n\t\n"
)


def lvm(path, tables):
    """SignalExpress text with a decimal comma, a segment a blow, names and units of the user."""
    text = _LVM_HEAD
    for k, table in enumerate(tables):
        step = f"{1 / FS:.12g}".replace(".", ",")
        text += "Channels\t4\t\t\t\t\n" + f"Samples\t{SAMPLES}\t{SAMPLES}\t{SAMPLES}\t{SAMPLES}\t\n"
        text += "Y_Unit_Label\tNewtons\tg\tg\tg\t\nX_Dimension\tTime\tTime\tTime\tTime\t\nX0\t0\t0\t0\t0\t\n"
        text += f"Delta_X\t{step}\t{step}\t{step}\t{step}\t\n***End_of_Header***\t\t\t\t\t\n"
        text += "X_Value\tDev1_ai0 (Hammer)\tDev1_ai1\tDev1_ai2\tDev1_ai3\tComment\n"
        for t, row in zip(time_axis(), (table / np.array([[1], [G], [G], [G]])).T, strict=True):
            text += "\t".join(f"{x:.9g}".replace(".", ",") for x in (t, *row)) + "\n"
        text += "\t\n" if k < len(tables) - 1 else ""
    path.write_text(text, encoding="cp1252")


def set58(**fields):
    """A data set 58 as pyuff takes it, with every field that it needs."""
    base = pyuff.prepare_58(
        binary=0, func_type=4, rsp_node=1, rsp_dir=1, ref_node=1, ref_dir=1, id1="NONE", load_case_id=0,
        rsp_ent_name="NONE", ref_ent_name="NONE", abscissa_spacing=1, abscissa_spec_data_type=18,
        ordinate_spec_data_type=12, orddenom_spec_data_type=13, z_axis_spec_data_type=0,
        x=np.arange(1.0, 41.0), data=np.arange(40) * (1 + 2j),
    )  # fmt: skip
    return base | fields


def uff(path, sets):
    pyuff.UFF(str(path)).write_sets(sets, mode="overwrite")


def uff_frfs(path, freq, data, nodes=((101, 1), (101, 3), (102, 1)), references=((101, 1),)):
    """FRFs of some nodes to some references, shape (reference, response, frequency)."""
    uff(
        path,
        [
            set58(
                rsp_node=node, rsp_dir=direction, ref_node=ref[0], ref_dir=ref[1], x=freq, data=data[r, k],
                ordinate_axis_units_lab="m/s^2", orddenom_axis_units_lab="N",
            )
            for r, ref in enumerate(references)
            for k, (node, direction) in enumerate(nodes)
        ],
    )  # fmt: skip
