"""
Draw the picture of the README: the response over the rail, and the demonstration measured and modelled.

    make demo
    .venv/bin/python docs/make_readme_picture.py cutvib-demo/corrected-machine.toml
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.colors import LogNorm

import cutvib_ss as cv
from cutvib_ss.plot.style import CORRECTED, GREY, MEASURED, NOMINAL, WORKING_FREQUENCY, colour_bar, drawing, png
from cutvib_ss.units import STANDARD_GRAVITY

TARGET = Path(__file__).parent / "figures" / "readme.png"
DEMO = Path(cv.__file__).parent / "data" / "demo"


def main(corrected: str) -> None:
    """Draw both panels and write the picture."""
    rail, freq = np.arange(1, 100) / 100, np.arange(5.0, 501.0)
    frf = cv.frequency_response(cv.published_machine(), rail, freq, outputs=["tool_x"])
    campaign = cv.read_campaign(DEMO)
    measured = cv.estimate(campaign.records[2]).sel(output="tool_x")
    lines = np.arange(150.0, 290.0, 0.5)
    with drawing(9.6, 3.4) as figure:
        left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.35))
        norm = LogNorm(0.005, 5.0)
        left.pcolormesh(rail, freq, np.abs(frf.data[:, 0, 0]).T, cmap="magma", norm=norm, rasterized=True)
        left.axhline(WORKING_FREQUENCY, color="white", linestyle=":", linewidth=1.0)
        left.set(xlim=(0.0, 1.0), xlabel="head's position on the rail, y/L", ylabel="frequency [Hz]")
        left.set_title("Model: acceleration of the tool")
        left.grid(False)
        colour_bar(figure, left, "magma", norm, "(m/s²)/N")

        shown = (measured.freq >= lines[0]) & (measured.freq <= lines[-1])
        modulus = np.abs(measured.data[0, 0, 0, shown]) / STANDARD_GRAVITY
        right.plot(measured.freq[shown], modulus, color=MEASURED, linewidth=3.5, label="measured")
        for machine, colour, style, label in (
            (campaign.machine, NOMINAL, "--", "nominal model"),
            (cv.read_machine(corrected), CORRECTED, "-", "corrected model"),
        ):
            model = cv.frequency_response(machine, [0.46], lines, outputs=["tool_x"])
            right.plot(lines, np.abs(model.data[0, 0, 0]) / STANDARD_GRAVITY, style, color=colour, label=label)
        right.axvline(WORKING_FREQUENCY, color=GREY, linestyle=":", linewidth=1.0)
        right.set(xlim=(lines[0], lines[-1]), xlabel="frequency [Hz]", ylabel="accelerance of the tool [g/N]")
        right.set_title("Demonstration campaign, y/L = 0.46")
        right.set_ylim(bottom=0.0)
        right.legend(loc="upper left")
        TARGET.write_bytes(png(figure, dpi=120.0))
    print(f"written: {TARGET}")


if __name__ == "__main__":
    main(sys.argv[1])
